"""The screen of ``compax monitor``: what is known of each axis, what may be done to it, and how both are shown."""

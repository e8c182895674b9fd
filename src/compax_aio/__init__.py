"""Move servo axes over a serial line or TCP and await the position reached."""

"""Moves of any device: awaited, watched, stopped and cancelled alike, whatever the device is told to make them."""

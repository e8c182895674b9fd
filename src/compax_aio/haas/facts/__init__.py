"""
What is known of Haas controls of the 1990s and 2000s and their RS-232 port, as frozen tables with their sources.

``sources``: what each of them is. ``characters``: control characters. ``eob``: ends of blocks. ``port_settings``: the
settings of the port. ``alarms``: of the port (numbers and texts are data, in ``alarms.toml``). ``programs`` and
``data_files``: what goes over the line. ``xmodem``: its numbers. ``queries``: machine data collection. ``variables``:
those worth reading, and those not to be written.
"""

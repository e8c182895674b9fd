"""
What is known of Roland CAMM-1 cutters and their relatives, as frozen tables with their sources.

``line``: signs, units, times. ``instructions``: device control. ``handshakes``: presets, thresholds, output.
``reports``: errors and status. ``mnemonics``: the cutting languages. ``models``: what each machine has.
"""

"""
The transfers of a control, sans-IO: how a file comes or goes by each of the four synchronisations, and drip feed.

``strategy`` is what all have in common, ``choosing`` picks one, ``framing`` finds the ``%`` lines of a file. A
transfer has no clock and no line: bytes in, bytes out, and how long the pause may be until something must come.
"""

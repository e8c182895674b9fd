"""
What goes over the line, taken apart and put together again, byte for byte: program files and files of numbered data.

``lines`` splits, ``program_file`` and ``data_file`` read, ``building`` makes what is sent, ``recogniser`` tells while
bytes arrive whether they have begun and ended.
"""

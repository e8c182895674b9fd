"""The command ``compax``, and what it says where its libraries are not installed."""

from __future__ import annotations

import io
import os
import sys

__all__ = ["main"]

_INTERRUPTED = 130


def main() -> int:
    """Run the command line of this process; returns the exit code."""
    _mend_streams()
    try:
        from .app import run  # noqa: PLC0415 - the libraries it needs are an extra
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "compax_aio":
            raise
        print(  # noqa: T201
            f"compax needs {error.name}, which is not installed; install the command with its libraries: "
            "pip install 'compax-aio[cli]'",
            file=sys.stderr,
        )
        return 2
    except KeyboardInterrupt:  # while all that was imported
        return _INTERRUPTED
    return run(sys.argv[1:])


def _mend_streams() -> None:
    """Let there be streams, where the shell has closed one, and let them take any text that we may have to tell."""
    for name in ("stdin", "stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # It takes the descriptor that is free, so that no file or port gets that of a stream.
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: PTH123, SIM115
        elif name != "stdin" and isinstance(stream, io.TextIOWrapper):
            # Names of files may be no text, and terminals may not know a degree sign.
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    sys.exit(main())

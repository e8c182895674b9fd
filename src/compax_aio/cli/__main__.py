"""The command ``compax``, and what it says where its libraries are not installed."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> int:
    """Run the command line of this process; returns the exit code."""
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
    return run(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())

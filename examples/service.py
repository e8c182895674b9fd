"""A service that moves one axis: clients connect by TCP and send a target on each line, or `where` or `stop`."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
from collections.abc import Sequence

import compax_aio
from compax_aio.compax.events import ConnectionLost


async def answer(axis: compax_aio.Drive, job: str) -> str:
    """Do one job, and say what came of it; a move that runs already is told as an error."""
    try:
        if job == "where":
            return f"at {await axis.position():.2f}"
        if job == "stop":
            await axis.stop()
            return f"stopped at {await axis.position():.2f}"
        result = await axis.move_to(float(job))
    except (compax_aio.CompaxError, ValueError) as error:
        return f"error: {error}"
    return f"reached {result.target:.2f}"


async def serve_client(axis: compax_aio.Drive, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Do a client's jobs one after the other until it hangs up."""
    with contextlib.closing(writer), contextlib.suppress(OSError, ValueError):  # hung up, or a line without end
        while line := await reader.readline():
            writer.write((await answer(axis, line.decode("ascii", "replace").strip()) + "\n").encode())
            await writer.drain()


async def serve(url: str, port: int) -> None:
    """Serve until cancelled, by SIGTERM or Ctrl-C; that stops the axis, wherever it is."""
    task = asyncio.current_task()
    assert task is not None
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    async with compax_aio.connect(url, name="axis") as axis, asyncio.TaskGroup() as clients:
        events = axis.events()
        await axis.home()

        def client_connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            clients.create_task(serve_client(axis, reader, writer))

        server = await asyncio.start_server(client_connected, "127.0.0.1", port)
        print(f"serving on port {server.sockets[0].getsockname()[1]}", flush=True)
        try:
            async for event in events:
                print(event, flush=True)
                if isinstance(event, ConnectionLost):
                    raise compax_aio.ConnectionLostError(event.reason)
        finally:
            server.close()  # the task group cancels the clients that are connected, and with them the move


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run until SIGTERM or Ctrl-C, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="Try: echo 120.5 | nc -q 5 127.0.0.1 8120")
    parser.add_argument("url", nargs="?", default="sim://compax", help="line of the drive (default: a simulated one)")
    parser.add_argument("--port", type=int, default=8120, help="TCP port to listen on (%(default)s)")
    options = parser.parse_args(argv)
    status = 0
    try:
        asyncio.run(serve(options.url, options.port))
    except* compax_aio.CompaxError as group:
        print(*group.exceptions, sep="\n", file=sys.stderr)
        status = 1
    except* (asyncio.CancelledError, KeyboardInterrupt):
        print("terminated; the axis was stopped and its line closed")
    return status


if __name__ == "__main__":
    sys.exit(main())

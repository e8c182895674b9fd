"""An HTTP service with several axes: move, home and stop them, and follow their positions as a live stream."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import re
import signal
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Annotated, Any

try:
    from fastapi import APIRouter, Depends, FastAPI, HTTPException, Query, Request
    from fastapi.responses import JSONResponse, StreamingResponse
    from pydantic import BaseModel, ConfigDict
except ModuleNotFoundError as missing:
    sys.exit(f"this example needs {missing.name}: pip install fastapi uvicorn")

import compax_aio
from compax_aio.compax.watch import Reading

SIMULATED = ["x=sim://compax?machine_zero=-40", "y=sim://compax?machine_zero=-25"]

# The first that fits counts. 4xx: ask for something else, or later. 5xx: go and look at the machine.
HTTP_CODES: list[tuple[type[compax_aio.CompaxError], int]] = [
    (compax_aio.MoveActiveError, 409),  # a move is running on that axis
    (compax_aio.MoveStoppedError, 409),  # somebody has stopped it
    (compax_aio.MoveInDoubtError, 423),  # locked, until somebody has looked and called /reconcile
    (compax_aio.InvalidCommandError, 422),  # the drive cannot be told this; nothing was sent
    (compax_aio.CommandRejectedError, 409),  # the drive has refused it as it stands
    (compax_aio.DriveFaultError, 503),
    (compax_aio.TransportError, 503),
    (compax_aio.MoveTimeoutError, 504),
    (compax_aio.AnswerTimeoutError, 504),
    (compax_aio.CompaxError, 502),
]


OLD_AFTER_S = 1.0
"""So much later than it was due, a reading says nothing of where an axis is now."""


class Target(BaseModel):
    """Where to go; positions are in the axis's own unit, from machine zero."""

    model_config = ConfigDict(extra="forbid", strict=True)  # "sped_percent" would be a move at any speed

    position: float
    speed_percent: float | None = None


class Cell:
    """The axes of the service, while it runs."""

    def __init__(self, urls: Mapping[str, str]) -> None:
        self.urls = urls
        self.group: compax_aio.DriveGroup | None = None
        self.moves: dict[str, compax_aio.Move] = {}
        self.ending = asyncio.Event()
        self.failure: compax_aio.CompaxError | None = None

    @contextlib.asynccontextmanager
    async def lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        """Open all lines before the first request; leaving the block stops all axes at once and closes their lines."""
        try:
            async with compax_aio.DriveGroup.connect(self.urls) as self.group, asyncio.TaskGroup() as tasks:
                guard = tasks.create_task(self.stop_when_it_ends())
                yield
                self.ending.set()
                await guard
        except* compax_aio.CompaxError as errors:
            self.failure = next(error for error in errors.exceptions if isinstance(error, compax_aio.CompaxError))
            raise

    async def stop_when_it_ends(self) -> None:
        """Stop the axes at once when the service is told to end: not when the last client has hung up."""
        await self.ending.wait()
        await self.open_group.stop()

    @property
    def open_group(self) -> compax_aio.DriveGroup:
        """All axes, connected."""
        assert self.group is not None, "requests come while the lifespan is entered"
        return self.group

    def axis(self, name: str) -> compax_aio.Drive:
        """Return the drive of that name, or answer that there is none."""
        if name not in self.urls:
            raise HTTPException(404, f"there is no axis {name!r}; there are {', '.join(self.urls)}")
        return self.open_group[name]

    async def start(self, name: str, move: compax_aio.Move, *, wait: bool) -> JSONResponse:
        """Answer when the drive has taken a move, or when it is over; it goes on whoever hangs up."""
        self.moves[name] = move
        move.add_done_callback(lambda done: done.cancelled() or done.exception())  # told when /axes is asked
        await (move if wait else move.accepted)
        return JSONResponse(self.told(name), status_code=200 if wait else 202)

    def told(self, name: str) -> dict[str, Any]:
        """Say what became of the last move of an axis."""
        move = self.moves.get(name)
        if move is None:
            return {"axis": name, "move": None}
        if not move.done():
            return {"axis": name, "move": "running", "target": move.target}
        error = None if move.cancelled() else move.exception()
        ended = "cancelled" if move.cancelled() else "reached" if error is None else type(error).__name__
        return {"axis": name, "move": ended, "target": move.target, "error": str(error) if error else None}

    async def positions(self, interval_s: float) -> AsyncIterator[str]:
        """Give the positions of all axes as events, null for one that does not answer; clients share one poller."""
        loop, old_after_s = asyncio.get_running_loop(), interval_s + OLD_AFTER_S
        readings: Mapping[str, Reading] = {}
        with self.open_group.watch("position", interval_s=interval_s) as watch:
            while not self.ending.is_set():
                news = asyncio.ensure_future(anext(watch))
                ending = asyncio.ensure_future(self.ending.wait())
                try:
                    await asyncio.wait([news, ending], timeout=old_after_s, return_when=asyncio.FIRST_COMPLETED)
                    readings = news.result() if news.done() else readings
                finally:
                    news.cancel()
                    ending.cancel()
                now = {axis: reading for axis, reading in readings.items() if loop.time() - reading.at < old_after_s}
                told = {axis: now[axis].values.get("position") if axis in now else None for axis in self.urls}
                yield f"data: {json.dumps(told)}\n\n"


async def cell_of(request: Request) -> Cell:
    """Find the axes that a request is about; asynchronous, or FastAPI would call it in a thread."""
    cell: Cell = request.app.state.cell
    return cell


Axes = Annotated[Cell, Depends(cell_of)]
router = APIRouter()


@router.get("/axes")
async def axes(cell: Axes) -> dict[str, Any]:
    """Tell where all axes are, and what became of their last moves."""
    positions = await asyncio.gather(*(cell.axis(name).position() for name in cell.urls), return_exceptions=True)
    return {
        name: {**cell.told(name), **({"lost": str(read)} if isinstance(read, BaseException) else {"position": read})}
        for name, read in zip(cell.urls, positions, strict=True)
    }


@router.get("/positions")
async def positions(cell: Axes, interval_s: Annotated[float, Query(gt=0.01, le=60)] = 0.2) -> StreamingResponse:
    """Follow the positions as server-sent events: they go one way, and a browser opens them again by itself."""
    return StreamingResponse(cell.positions(interval_s), media_type="text/event-stream")


@router.post("/axes/{name}/move")
async def move(cell: Axes, name: str, target: Target, wait: bool = False) -> JSONResponse:
    """Start a move: 202 when the drive has taken it; with ``wait=true`` 200 when the axis is there."""
    started = cell.axis(name).move_to(target.position, speed_percent=target.speed_percent)
    return await cell.start(name, started, wait=wait)


@router.post("/axes/{name}/home")
async def home(cell: Axes, name: str, wait: bool = False) -> JSONResponse:
    """Find machine zero; answers as a move does."""
    return await cell.start(name, cell.axis(name).home(), wait=wait)


@router.post("/axes/{name}/stop")
async def stop(cell: Axes, name: str) -> dict[str, Any]:
    """Stop one axis; answers when it stands."""
    await cell.axis(name).stop()
    return cell.told(name)


@router.post("/axes/{name}/quit")
async def acknowledge(cell: Axes, name: str) -> dict[str, Any]:
    """Acknowledge the error of a drive, when its cause is gone."""
    await cell.axis(name).quit()
    return cell.told(name)


@router.post("/axes/{name}/reconcile")
async def reconcile(cell: Axes, name: str) -> dict[str, Any]:
    """Let an axis move again whose move was in doubt, after somebody has looked at the machine."""
    status = await cell.axis(name).reconcile()
    return {"axis": name, "command_active": status.command_active, "position_reached": status.position_reached}


@router.post("/stop")
async def stop_all(cell: Axes) -> dict[str, Any]:
    """Stop all axes at once; answers when they stand."""
    await cell.open_group.stop()
    return {name: cell.told(name) for name in cell.urls}


async def tell(_: Request, error: Exception) -> JSONResponse:
    """Answer with what the library says, and the code that fits."""
    assert isinstance(error, compax_aio.CompaxError)
    code = next(code for kind, code in HTTP_CODES if isinstance(error, kind))
    told = {key: getattr(error, key) for key in ("what", "hint", "device", "sent", "received")}
    return JSONResponse({"error": type(error).__name__, **told}, status_code=code)


def create_app(urls: Mapping[str, str]) -> FastAPI:
    """Make the application; *urls* are the lines of its axes by name."""
    cell = Cell(urls)
    app = FastAPI(title="Axes", lifespan=cell.lifespan)
    app.state.cell = cell
    app.include_router(router)
    app.add_exception_handler(compax_aio.CompaxError, tell)
    return app


async def serve(app: FastAPI, port: int) -> None:
    """Serve until Ctrl-C or SIGTERM."""
    import uvicorn  # noqa: PLC0415  # any other ASGI server does as well

    cell: Cell = app.state.cell
    loop = asyncio.get_running_loop()

    class Server(uvicorn.Server):
        async def startup(self, *arguments: Any, **more: Any) -> None:
            await super().startup(*arguments, **more)
            for each in self.servers:
                at = each.sockets[0].getsockname()[1]
                print(f"axes {', '.join(cell.urls)} on http://127.0.0.1:{at}/axes, try them on /docs", flush=True)

        def handle_exit(self, sig: int, frame: Any) -> None:
            loop.call_soon_threadsafe(cell.ending.set)  # axes stop, and streams end; uvicorn would wait for them
            super().handle_exit(sig, frame)

    config = uvicorn.Config(app, port=port, lifespan="on", log_level="critical", timeout_graceful_shutdown=5)
    try:
        await Server(config).serve()
    except SystemExit as gave_up:  # of uvicorn, which could not begin
        if cell.failure is None:
            raise compax_aio.TransportError(f"port {port} is taken", hint="choose another one: --port") from gave_up
    if cell.failure is not None:
        raise cell.failure


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, serve, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Real axes really move: nobody is asked who he is, so let only those reach the port who may. Ctrl-C "
        "stops all axes; it is no emergency stop. Try: curl -N localhost:8000/positions & "
        "curl localhost:8000/axes/x/move --json '{\"position\": 120.5}'",
    )
    parser.add_argument(
        "axes", nargs="*", default=SIMULATED, help="NAME=URL of each axis, or its URL alone (default: simulated ones)"
    )
    parser.add_argument("--port", type=int, default=8000, help="TCP port of this computer to listen on (%(default)s)")
    options = parser.parse_args(argv)
    named = [re.fullmatch(r"(?:(\w+)=)?(\w+://.*)", axis) for axis in options.axes]
    if not all(named):
        parser.error("axes are written as NAME=URL, like x=serial:///dev/ttyUSB0?baudrate=9600")
    urls = {found[1] or f"axis{number}": found[2] for number, found in enumerate(named, start=1) if found}
    if len(urls) < len(named):
        parser.error("each axis has a name of its own")
    if not 0 <= options.port <= 65535:
        parser.error("--port is 0 to 65535; 0 is any that is free")
    try:
        asyncio.run(serve(create_app(urls), options.port))
    except (compax_aio.CompaxError, ModuleNotFoundError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:  # uvicorn hands signals on when all is done
        pass
    print("terminated; the axes were stopped and their lines closed")
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(main())

"""A step scan in the manner of Bluesky: a motor and a detector as devices, and the scan as a stream of documents."""

from __future__ import annotations

import argparse
import asyncio
import importlib
import json
import math
import sys
import time
import uuid
from collections.abc import Callable, Generator, Sequence
from typing import Any

import compax_aio
from compax_aio.compax.vocabulary import plan_move_to

SIMULATED = "sim://compax?machine_zero=-10"

Emit = Callable[[str, dict[str, Any]], None]
"""Takes a document: its name, ``start``, ``descriptor``, ``event`` or ``stop``, and what it says."""


class Status:
    """What bluesky.protocols.Status asks for, made of a future: a move, or a reading; it can be awaited as well."""

    def __init__(self, future: asyncio.Future[Any]) -> None:
        self.future = future
        # Whoever looks at the status is told how it ended; asyncio need not complain that nobody did.
        future.add_done_callback(lambda _: self.exception())

    def add_callback(self, callback: Callable[[Status], None]) -> None:
        """Call *callback* when it is over; at once if it is."""
        if self.done:
            callback(self)
        else:
            self.future.add_done_callback(lambda _: callback(self))

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """Return why it failed, if it did; it is not waited for, for that is what await does."""
        del timeout
        if not self.done:
            return None
        return asyncio.CancelledError() if self.future.cancelled() else self.future.exception()

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.future.done()

    @property
    def success(self) -> bool:
        """Whether it ended well."""
        return self.done and self.exception() is None

    def __await__(self) -> Generator[Any, None, Any]:
        return self.future.__await__()


class Motor:
    """An axis as Bluesky's Movable, Readable, Locatable and Stoppable."""

    parent = None

    def __init__(self, name: str, drive: compax_aio.Drive, speed_percent: float = 100) -> None:
        self.name = name
        self.drive = drive
        self.speed_percent = speed_percent
        self.setpoint = math.nan

    @property
    def hints(self) -> dict[str, Any]:
        """What is worth to be shown."""
        return {"fields": [self.name]}

    def set(self, value: float) -> Status:
        """Start a move; the status is done at position reached, or has the error that says why not."""
        self.setpoint = value
        return Status(self.drive.move_to(value, speed_percent=self.speed_percent))

    async def stop(self, success: bool = True) -> None:
        """Stop, ahead of everything; returns at standstill."""
        del success
        await self.drive.stop()

    async def read(self) -> dict[str, Any]:
        """Ask the drive where the axis is: what it was told is no reading."""
        return {self.name: {"value": await self.drive.position(), "timestamp": time.time()}}

    async def describe(self) -> dict[str, Any]:
        """Say what a reading is."""
        source = f"COMPAX:{self.drive.name}:S1"
        return {self.name: {"source": source, "dtype": "number", "shape": [], "units": self.drive.unit}}

    async def locate(self) -> dict[str, float]:
        """Say where it was told to go, and where it is."""
        return {"setpoint": self.setpoint, "readback": await self.drive.position()}


class Detector:
    """A detector that looks at a peak; yours is Triggerable and Readable, too."""

    parent = None

    def __init__(self, name: str, motor: Motor, centre: float, exposure_s: float) -> None:
        self.name = name
        self.motor, self.centre, self.exposure_s = motor, centre, exposure_s
        self.hints = {"fields": [name]}
        self._counts = 0.0

    def trigger(self) -> Status:
        """Expose; the status is done when there is something to read."""
        return Status(asyncio.ensure_future(self._expose()))

    async def _expose(self) -> None:
        await asyncio.sleep(self.exposure_s)
        self._counts = round(1000 * math.exp(-(((await self.motor.drive.position() - self.centre) / 12) ** 2)), 1)

    async def read(self) -> dict[str, Any]:
        """Give the counts of the last exposure."""
        return {self.name: {"value": self._counts, "timestamp": time.time()}}

    async def describe(self) -> dict[str, Any]:
        """Say what a reading is."""
        return {self.name: {"source": "simulated", "dtype": "number", "shape": []}}


class Pause:
    """Holds a scan between two points: :meth:`pause`, :meth:`resume`; the axis stands meanwhile."""

    def __init__(self) -> None:
        self._free = asyncio.Event()
        self._free.set()

    def pause(self) -> None:
        """Begin no other point."""
        self._free.clear()

    def resume(self) -> None:
        """Go on."""
        self._free.set()

    async def passed(self) -> None:
        """Wait until nobody holds the scan."""
        await self._free.wait()


async def scan(  # noqa: PLR0917  # the first five are those of bluesky.plans.scan
    detectors: Sequence[Detector], motor: Motor, start: float, stop: float, num: int, emit: Emit, pause: Pause
) -> None:
    """
    Step *motor* through *num* points and read *detectors* at each; *emit* is given the documents of the run.

    However it ends early, by an error or by being cancelled, the axis is stopped, and the last document says so.
    """
    run, descriptor = str(uuid.uuid4()), str(uuid.uuid4())
    devices: list[Motor | Detector] = [motor, *detectors]
    points, told = 0, {"exit_status": "success", "reason": ""}
    emit("start", {"uid": run, "time": time.time(), "plan_name": "scan", "motors": [motor.name], "num_points": num})
    try:
        keys = {key: value for device in devices for key, value in (await device.describe()).items()}
        about = {"uid": descriptor, "run_start": run, "time": time.time(), "name": "primary", "data_keys": keys}
        emit("descriptor", about)
        for point in range(num):
            await pause.passed()
            await motor.set(start + (stop - start) * point / max(num - 1, 1))
            await asyncio.gather(*(detector.trigger().future for detector in detectors))
            readings = {key: value for device in devices for key, value in (await device.read()).items()}
            points += 1
            event = {"uid": str(uuid.uuid4()), "descriptor": descriptor, "seq_num": points, "time": time.time()}
            event["data"] = {key: reading["value"] for key, reading in readings.items()}
            event["timestamps"] = {key: reading["timestamp"] for key, reading in readings.items()}
            emit("event", event)
    except BaseException as error:
        is_fault = isinstance(error, Exception) and not isinstance(error, compax_aio.MoveStoppedError)
        told = {"exit_status": "fail" if is_fault else "abort", "reason": str(error) or type(error).__name__}
        await motor.stop(success=False)
        raise
    finally:
        ended = {"uid": str(uuid.uuid4()), "run_start": run, "time": time.time(), "num_events": {"primary": points}}
        emit("stop", {**ended, **told})


def print_table(name: str, document: dict[str, Any]) -> None:
    """Print the readings as a table, and how the run ended."""
    if name == "descriptor":
        print("point  " + "".join(f"{key:>12}" for key in document["data_keys"]))
    elif name == "event":
        print(f"{document['seq_num']:5}  " + "".join(f"{value:12.2f}" for value in document["data"].values()))
    elif name == "stop":
        points = sum(document.get("num_events", {}).values())
        print(f"{document['exit_status']}: {points} points {document['reason']}".rstrip())


def print_json(name: str, document: dict[str, Any]) -> None:
    """Print a document on a line, for whatever reads Bluesky's."""
    print(json.dumps([name, document]), flush=True)


async def run(options: argparse.Namespace, emit: Emit, pause: Pause) -> None:
    """Connect, home, and scan; a scan that leaves what the axis can do begins with nothing."""
    async with compax_aio.connect(options.url, name="axis") as drive:
        for end in (options.start, options.stop):
            plan_move_to(end, drive.settings)
        await drive.home()
        motor = Motor("x", drive)
        detector = Detector("counts", motor, (options.start + options.stop) / 2, options.exposure)
        await scan([detector], motor, options.start, options.stop, options.num, emit, pause)


def run_in_bluesky(options: argparse.Namespace, emit: Emit) -> None:
    """Let Bluesky's own RunEngine scan with the same devices; they live in its event loop, in a thread of its own."""
    engine_module = importlib.import_module("bluesky.run_engine")
    plans = importlib.import_module("bluesky.plans")
    engine = engine_module.RunEngine({})
    in_its_loop = engine_module.call_in_bluesky_event_loop

    async def open_drive() -> compax_aio.Drive:
        drive = await compax_aio.connect(options.url, name="axis")
        try:
            await drive.home()
        except BaseException:
            await drive.close()
            raise
        return drive

    drive = in_its_loop(open_drive())
    try:
        motor = Motor("x", drive)
        detector = Detector("counts", motor, (options.start + options.stop) / 2, options.exposure)
        engine(plans.scan([detector], motor, options.start, options.stop, options.num), emit)
    except engine_module.RunEngineInterrupted:
        engine.abort("interrupted")  # the axis was stopped when it paused
        raise KeyboardInterrupt from None
    finally:
        in_its_loop(drive.close())


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, scan, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real axis really moves, from --start to --stop. Ctrl-C stops it; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="line of the drive (default: a simulated one)")
    parser.add_argument("--start", type=float, default=0, help="position of the first point (%(default)s)")
    parser.add_argument("--stop", type=float, default=100, help="position of the last point (%(default)s)")
    parser.add_argument("--num", type=int, default=11, help="how many points (%(default)s)")
    parser.add_argument("--exposure", type=float, default=0.1, metavar="S", help="at each point (%(default)s)")
    parser.add_argument("--json", action="store_true", help="print documents, a line each, in place of a table")
    parser.add_argument(
        "--bluesky",
        action="store_true",
        help="let Bluesky's RunEngine do it (pip install bluesky); "
        "its first Ctrl-C ends it behind the point, its second at once",
    )
    options = parser.parse_args(argv)
    if options.num < 1:
        parser.error("--num is 1 or more")
    if not 0 <= options.exposure < math.inf:
        parser.error("--exposure is a time in seconds, 0 or more")
    emit = print_json if options.json else print_table
    try:
        if options.bluesky:
            run_in_bluesky(options, emit)
        else:
            asyncio.run(run(options, emit, Pause()))
    except (compax_aio.CompaxError, ImportError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axis was stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

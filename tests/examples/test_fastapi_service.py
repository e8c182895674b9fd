"""The HTTP service moves axes, tells what the library says, streams positions, and leaves nothing moving."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import signal
import socket
import sys
from collections.abc import AsyncIterator, MutableMapping
from contextlib import asynccontextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from compax_aio.simulator.compax import LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_tcp
from compax_aio.testing import Faults, SimulatedGroup

EXAMPLE = Path(__file__).parents[2] / "examples" / "fastapi_service.py"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("example_fastapi_service", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@asynccontextmanager
async def service(axes: SimulatedGroup) -> AsyncIterator[tuple[httpx.AsyncClient, FastAPI]]:
    """Run the service without a network, in virtual time, on drives x and y."""
    axes.add("x", "y", machine_zero=-20.0)
    app: FastAPI = load().create_app(axes.urls)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://cell") as client,
    ):
        yield client, app


async def test_an_axis_is_homed_and_moved(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, _):
        assert (await client.post("/axes/x/home?wait=true")).json() == {
            "axis": "x",
            "move": "reached",
            "target": None,
            "error": None,
        }
        answer = await client.post("/axes/x/move?wait=true", json={"position": 120.5, "speed_percent": 50})
        assert (answer.status_code, answer.json()["move"], answer.json()["target"]) == (200, "reached", 120.5)
        told = (await client.get("/axes")).json()
        assert told["x"] == {"axis": "x", "move": "reached", "target": 120.5, "error": None, "position": 120.5}
        assert told["y"] == {"axis": "y", "move": None, "position": 0.0}
    assert [motion.target for motion in simulated_group["x"].motions] == [-20.0, 120.5]
    assert "SD50" in simulated_group["x"].lines


async def test_a_move_goes_on_after_it_was_accepted_and_a_second_one_is_a_conflict(
    simulated_group: SimulatedGroup,
) -> None:
    async with service(simulated_group) as (client, _):
        answer = await client.post("/axes/x/move", json={"position": 500})
        assert (answer.status_code, answer.json()) == (202, {"axis": "x", "move": "running", "target": 500.0})
        second = await client.post("/axes/x/move", json={"position": 20})
        assert (second.status_code, second.json()["error"]) == (409, "MoveActiveError")
        assert second.json()["hint"].startswith("await it or stop it first")
        assert (await client.post("/axes/y/move?wait=true", json={"position": 10})).status_code == 200
        await simulated_group["x"].until_standing()
        assert [motion.target for motion in simulated_group["x"].motions] == [500.0]


async def test_one_axis_is_stopped_or_all(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, _):
        for axis in "xy":
            await client.post(f"/axes/{axis}/move", json={"position": 500})
        await asyncio.sleep(0.3)
        told = (await client.post("/axes/x/stop")).json()
        assert (told["move"], told["target"]) == ("MoveStoppedError", 500.0)
        assert simulated_group["y"].moving
        waiting = asyncio.create_task(client.post("/axes/x/move?wait=true", json={"position": 400}))
        await asyncio.sleep(0.3)
        told = (await client.post("/stop")).json()
        assert {axis: each["move"] for axis, each in told.items()} == dict.fromkeys("xy", "MoveStoppedError")
        assert (await waiting).status_code == 409
        for each in simulated_group.values():
            each.assert_stopped()


@pytest.mark.parametrize(
    ("path", "body", "code", "says"),
    [
        ("/axes/q/home", None, 404, "there is no axis 'q'; there are x, y"),
        ("/axes/x/move", {"position": 9e9}, 422, "within ±4,000,000 units"),
        ("/axes/x/move", {"position": "up"}, 422, "valid number"),
        ("/axes/x/move", {"position": 1, "speed_percent": -1}, 422, "speed"),
        ("/axes/x/move", {"position": 1, "sped_percent": 5}, 422, "sped_percent"),
        ("/axes/x/move", {"position": True}, 422, "valid number"),
        ("/axes/x/move", {"position": "12"}, 422, "valid number"),
        ("/positions?interval_s=0", None, 405, "Not Allowed"),
    ],
)
async def test_what_cannot_be_done_is_told_and_not_sent(
    simulated_group: SimulatedGroup, path: str, body: Any, code: int, says: str
) -> None:
    async with service(simulated_group) as (client, _):
        answer = await client.post(path, json=body)
        assert (answer.status_code, says in answer.text) == (code, True), answer.text
    simulated_group["x"].assert_never_moved()


async def test_no_reading_is_taken_more_often_than_a_line_can(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, _):
        assert (await client.get("/positions?interval_s=0")).status_code == 422


async def test_a_target_that_the_drive_refuses_is_a_conflict(simulated_group: SimulatedGroup) -> None:
    simulated_group.add("z", travel_max=100.0)
    app: FastAPI = load().create_app({"z": "test://z"})
    async with app.router.lifespan_context(app):
        client = httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://cell")
        answer = await client.post("/axes/z/move", json={"position": 150})
        assert (answer.status_code, answer.json()["received"]) == (409, "E93")
        await client.aclose()


async def test_a_fault_is_told_and_acknowledged(simulated_group: SimulatedGroup, faults: Faults) -> None:
    async with service(simulated_group) as (client, _):
        faults.of("x").after(0.5).raise_fault(55)
        answer = await client.post("/axes/x/move?wait=true", json={"position": 500})
        assert (answer.status_code, answer.json()["error"]) == (503, "DriveFaultError")
        assert answer.json()["hint"] == "release the emergency stop, then quit()"
        assert (await client.post("/axes/x/quit")).status_code == 200
        assert (await client.post("/axes/x/move?wait=true", json={"position": 10})).status_code == 200


async def test_an_axis_in_doubt_is_locked_until_somebody_has_looked(
    simulated_group: SimulatedGroup, faults: Faults
) -> None:
    async with service(simulated_group) as (client, _):
        await client.post("/axes/x/move", json={"position": 500})
        faults.of("x").silent(for_s=60)
        await asyncio.sleep(45)
        answer = await client.post("/axes/x/move", json={"position": 0})
        assert (answer.status_code, answer.json()["error"]) == (423, "MoveInDoubtError")
        assert "reconcile()" in answer.json()["hint"]
        told = (await client.get("/axes")).json()
        assert "lost" in told["x"]
        assert told["y"]["position"] == 0.0
        await asyncio.sleep(30)
        assert (await client.post("/axes/x/reconcile")).json()["position_reached"]
        assert (await client.post("/axes/x/move?wait=true", json={"position": 0})).status_code == 200


async def test_a_line_that_is_lost_is_told(simulated_group: SimulatedGroup, faults: Faults) -> None:
    async with service(simulated_group) as (client, _):
        faults.of("x").cut_line(for_s=5)
        await asyncio.sleep(1)
        answer = await client.post("/axes/x/move", json={"position": 1})
        assert (answer.status_code, answer.json()["error"]) == (503, "ConnectionLostError")
        await asyncio.sleep(20)
        assert (await client.post("/axes/x/move?wait=true", json={"position": 1})).status_code == 200


# The stream


@asynccontextmanager
async def stream(app: FastAPI) -> AsyncIterator[list[dict[str, Any]]]:
    """Follow the positions as a server lets a client do that hangs up in the end; httpx waits for the last byte."""
    seen: list[dict[str, Any]] = []
    hung_up = asyncio.Event()

    async def receive() -> dict[str, Any]:
        await hung_up.wait()
        return {"type": "http.disconnect"}

    async def send(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            assert (b"content-type", b"text/event-stream; charset=utf-8") in message["headers"]
        elif message["body"]:
            assert message["body"].startswith(b"data: ")
            assert message["body"].endswith(b"\n\n")
            seen.append(json.loads(message["body"].removeprefix(b"data: ")))

    scope = {"type": "http", "method": "GET", "path": "/positions", "query_string": b"interval_s=0.1", "headers": []}
    following = asyncio.create_task(app({**scope, "asgi": {"version": "3.0"}}, receive, send))
    yield seen
    hung_up.set()
    await following


async def test_positions_are_followed_by_any_number_of_clients(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, app):
        async with stream(app) as seen, stream(app) as also_seen:
            await client.post("/axes/x/move?wait=true", json={"position": 100})
            await asyncio.sleep(0.5)
        assert len(seen) > 8
        assert seen[0]["x"] < 10
        assert seen[-1] == {"x": 100.0, "y": 0.0}
        assert [each["x"] for each in seen] == sorted(each["x"] for each in seen)
        assert also_seen == seen
        lines = len(simulated_group["x"].lines)
        await asyncio.sleep(5)
        assert len(simulated_group["x"].lines) == lines, "it is read although nobody looks"


@pytest.mark.parametrize("cut", ["x", "xy"])
async def test_the_stream_gives_no_old_position_for_one_of_now(
    simulated_group: SimulatedGroup, faults: Faults, cut: str
) -> None:
    async with service(simulated_group) as (client, app), stream(app) as seen:
        await client.post("/axes/x/move?wait=true", json={"position": 100})
        for axis in cut:
            faults.of(axis).cut_line(for_s=5)
        await asyncio.sleep(2)
        assert seen[-1] == {"x": None, "y": None if "y" in cut else 0.0}
        await asyncio.sleep(1)
        before = len(seen)
        await asyncio.sleep(2.5)
        assert len(seen) > before + 1, "it goes on"
        await asyncio.sleep(15)
        assert seen[-1] == {"x": 100.0, "y": 0.0}


# The end


async def test_ending_stops_the_axes_and_the_streams(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, app):
        await client.post("/axes/x/move", json={"position": 1000})
        async with stream(app) as seen:
            await asyncio.sleep(1)
            app.state.cell.ending.set()
            await asyncio.sleep(0.5)
            simulated_group["x"].assert_stopped()
            count = len(seen)
            await asyncio.sleep(2)
            assert len(seen) == count
    assert not simulated_group["x"].connected


async def test_the_end_of_the_service_leaves_nothing_moving(simulated_group: SimulatedGroup) -> None:
    async with service(simulated_group) as (client, _):
        for axis in "xy":
            await client.post(f"/axes/{axis}/move", json={"position": 1000})
        await asyncio.sleep(1)
    for each in simulated_group.values():
        each.assert_stopped()
        assert not each.connected


def test_an_axis_is_written_as_name_and_url(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        load().main(["x=/dev/ttyUSB0"])
    assert "axes are written as NAME=URL" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [(["x=sim://compax", "x=sim://smc"], "a name of its own"), (["--port", "99999"], "0 to 65535")],
)
def test_words_that_cannot_be_meant_are_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    with pytest.raises(SystemExit):
        load().main(words)
    assert says in capsys.readouterr().err


def test_without_fastapi_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fastapi", None)
    with pytest.raises(SystemExit, match="needs fastapi: pip install fastapi uvicorn"):
        load()


def test_without_uvicorn_it_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert load().main([]) == 1
    assert "uvicorn" in capsys.readouterr().err


def test_a_port_that_is_taken_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert load().main(["--port", str(port)]) == 1
    assert capsys.readouterr().err == f"TransportError: port {port} is taken; choose another one: --port\n"


@pytest.mark.real_time
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_a_signal_ends_it_with_the_axes_stopped(number: signal.Signals) -> None:
    drive = SimulatedDrive()
    async with serve_tcp(drive) as url:
        process = await asyncio.create_subprocess_exec(
            sys.executable, EXAMPLE, f"x={url}", "--port", "0", stdout=asyncio.subprocess.PIPE
        )
        assert process.stdout is not None
        told = (await process.stdout.readline()).decode()
        assert told.startswith("axes x on http://127.0.0.1:")
        async with httpx.AsyncClient(base_url=told.split()[3].removesuffix("/axes,")) as client:
            assert (await client.post("/axes/x/move", json={"position": 10_000})).status_code == 202
            async with client.stream("GET", "/positions") as following:
                lines = following.aiter_lines()
                assert (await anext(lines)).startswith('data: {"x": ')
                process.send_signal(number)
                async for _ in lines:
                    pass
        assert await process.wait() == 0
        assert b"terminated; the axes were stopped and their lines closed" in await process.stdout.read()
        assert drive.log.texts(LogKind.MOTION_STOPPED)
        assert not drive.moving

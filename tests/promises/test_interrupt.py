"""Ctrl-C in a program stops its drive, wherever the program waits; the drive is served by this process, over TCP."""

from __future__ import annotations

import asyncio
import signal
import sys
import textwrap

import pytest
from tests.promises.bench import lines, motions

from compax_aio.simulator.compax import LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_tcp

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("nothing_left_behind")]

PROGRAM = """
    import asyncio, sys
    import compax_aio
    from compax_aio.compax.program import End, MoveTo

    async def main():
        {body}

    asyncio.run(main())
"""

BODIES = {
    "awaiting": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            await drive.move_to(1e6)
    """,
    "watching": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            async for _ in drive.move_to(1e6).positions():
                pass
    """,
    "waiting elsewhere": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            move = drive.move_to(1e6)
            await asyncio.sleep(1000)
    """,
    "in a group": """
        async with compax_aio.DriveGroup.connect({"x": sys.argv[1]}) as group:
            await group.move_to(x=1e6)
    """,
    "without a block": """
        drive = await compax_aio.connect(sys.argv[1])
        await asyncio.gather(drive.move_to(1e6), asyncio.sleep(1000))
    """,
    "with a plain line": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            await drive.command("PA1000000")
            await asyncio.sleep(1000)
    """,
    "while a program runs": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            await drive.program.download({1: MoveTo(1000000), 2: End()})
            await drive.program.start(1)
            await drive.program.wait_finished()
    """,
    "while somebody watches": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            move = drive.move_to(1e6)
            async for _ in drive.watch("position", "status", interval_s=0.01):
                pass
    """,
    "when prepared and triggered": """
        async with compax_aio.connect(sys.argv[1]) as drive:
            move = drive.prepare_move_to(1e6)
            await move.ready
            move.trigger()
            await move
    """,
}


async def interrupted(body: str) -> SimulatedDrive:
    """Run a program until its drive moves, interrupt it, and return the drive as it was when the program ended."""
    far = SimulatedDrive()
    async with asyncio.timeout(20), serve_tcp(far) as url:
        program = PROGRAM.format(body=textwrap.dedent(body).strip().replace("\n", "\n        "))
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", textwrap.dedent(program), url, stderr=asyncio.subprocess.PIPE
        )
        try:
            while not far.moving:
                assert process.returncode is None, await process.stderr.read()  # type: ignore[union-attr]
                await asyncio.sleep(0.005)
            await asyncio.sleep(0.05)
            process.send_signal(signal.SIGINT)
            _, errors = await process.communicate()
        finally:
            if process.returncode is None:
                process.kill()
                await process.communicate()
        assert b"KeyboardInterrupt" in errors
        assert b"never" not in errors
        assert b"pending" not in errors
        # It hung up only after the axis stood.
        assert len(motions(far)) == 1
    return far


@pytest.mark.parametrize("where", BODIES)
async def test_ctrl_c_stops_the_drive(where: str) -> None:
    far = await interrupted(BODIES[where])
    assert not far.moving
    assert "STOP" in lines(far)
    kinds = [entry.kind for entry in far.log]
    assert kinds.index(LogKind.MOTION_STOPPED) < kinds.index(LogKind.DISCONNECTED)


async def test_ctrl_c_lets_a_detached_move_go_on() -> None:
    body = """
        async with compax_aio.connect(sys.argv[1]) as drive:
            await drive.move_to(1e6, on_cancel="detach")
    """
    far = await interrupted(body)
    assert far.moving
    assert "STOP" not in lines(far)

"""
The conversations that the manuals print, held by the client, with every byte of both directions recorded.

Manuals print long forms and blanks in places; the client says the same in short forms, and the recordings show it. What
is the drive's own part is byte for byte as printed.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from tests.promises.bench import strangers_order

import compax_aio
from compax_aio import Drive, DriveSettings
from compax_aio.compax.binary import decode_number, encode_frame, encode_number
from compax_aio.compax.program import parse, wire_lines
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import listen

PROMPT = b"\r\n>"

# No question is asked on the way, so that a recording holds nothing but the conversation.
QUIETLY = DriveSettings(poll_first_s=1000, poll_slowest_s=1000, stall_timeout_s=5000, in_doubt_after_s=5000)


class Wire:
    """What has gone over the line since the drive was connected."""

    def __init__(self) -> None:
        self.turns: list[tuple[str, bytes]] = []

    def note(self, direction: str, data: bytes) -> None:
        if self.turns and self.turns[-1][0] == direction:
            data = self.turns.pop()[1] + data
        self.turns.append((direction, data))

    def take(self) -> list[tuple[str, bytes]]:
        turns, self.turns = self.turns, []
        return turns


def conversation(*turns: bytes) -> list[tuple[str, bytes]]:
    """Host and drive speak in turn, the host first."""
    return [("->" if place % 2 == 0 else "<-", data) for place, data in enumerate(turns)]


@asynccontextmanager
async def recorded(**knobs: Any) -> AsyncIterator[tuple[Drive, SimulatedDrive, Wire]]:
    far, wire = SimulatedDrive(Knobs(**knobs)), Wire()

    class RecordedConnection(Connection):
        def data_received(self, data: bytes) -> None:
            wire.note("->", data)
            super().data_received(data)

        def _send(self, data: bytes) -> None:
            wire.note("<-", data)
            super()._send(data)

    connections: set[Connection] = set()
    line = DeviceLine.of(far)
    with await listen("recorded", lambda: RecordedConnection(line, connections)) as listener:
        async with compax_aio.connect(listener.url, name="x", settings=QUIETLY) as drive:
            wire.take()
            yield drive, far, wire


async def test_the_comparators_of_the_manual() -> None:
    """UG p. 162: 2 after 100 units, 1 after 200, ``$`` after 1000."""
    async with recorded() as (drive, far, wire):
        move = drive.move_to(1000, comparators=[(200, 9), (100, 10)])
        assert [number async for number in move.comparators()] == [2, 1]
        assert (await move).confirmed_by == "message"
        assert wire.take() == conversation(
            b"PR200 OT O9=1\r", PROMPT,
            b"PR100 OT O10=1\r", PROMPT,
            b"PA1000$\r", PROMPT + b"2\r\n>" + b"1\r\n>" + b"$\r\n>",
        )  # fmt: skip
        assert (far.outputs[9], far.outputs[10]) == (True, True)


async def test_the_comparators_of_the_manual_line_by_line() -> None:
    """UG p. 162: the prepared points as they are printed; ``$`` itself is for moves, not for plain lines."""
    async with recorded() as (drive, _, wire):
        await drive.command("PR 200 OT O9=1")
        await drive.command("PR 100 OT O10=1")
        assert wire.take() == conversation(b"PR 200 OT O9=1\r", PROMPT, b"PR 100 OT O10=1\r", PROMPT)


async def test_the_error_history_of_the_manual() -> None:
    """UG p. 209."""
    async with recorded() as (drive, far, wire):
        for code, ends_by in ((20, "QUIT"), (10, "power"), (53, "QUIT"), (10, None), (55, "QUIT")):
            far.raise_fault(code)
            if ends_by == "QUIT":
                await drive.quit()
            elif ends_by == "power":
                far.power_cycle()
        wire.take()
        assert await drive.query("S18") == "S018: 99 55 10 99 53 98 10 99"
        assert wire.take() == conversation(b"S18\r", b"S018: 99 55 10 99 53 98 10 99\r\n>")
        history = await drive.error_history()
        assert [(entry.error.code, entry.ended_by) for entry in history] == [
            (55, "acknowledged"),
            (10, None),
            (53, "acknowledged"),
            (10, "power-on"),
        ]


async def test_bit_one_of_a_status_is_on_the_left_as_in_the_manual() -> None:
    """UG p. 209: S17 with only the password active is ``1000 0000``; RUN is off here as the power stage is."""
    async with recorded(status_bits_blank=True) as (drive, _, wire):
        await drive.command("OUTPUT O0=1")
        await drive.command("GOTO 302")
        wire.take()
        status = await drive.status()
        assert status.password_active
        assert not status.running
        assert wire.take() == conversation(b"S17\r", b"S017: 1000 0000\r\n>", b"S16\r", b"S016: 1101 0010\r\n>")


async def test_the_parameter_of_the_manual() -> None:
    """IBS p. 23: ``P003=-1055.88``, and ``POSR15.8`` without a blank."""
    async with recorded() as (drive, far, wire):
        await drive.command("GOTO 302")
        await drive.command("P003=-1055.88")
        assert await drive.query("P3") == "P003: -1055.880"
        await drive.command("POSR15.8")
        assert wire.take() == conversation(
            b"GOTO 302\r", PROMPT,
            b"P003=-1055.88\r", PROMPT,
            b"P3\r", b"P003: -1055.880\r\n>",
            b"POSR15.8\r", PROMPT,
        )  # fmt: skip
        await asyncio.sleep(5)
        assert far.position == pytest.approx(15.8)


async def test_a_record_is_written_and_read_in_the_style_of_the_listings() -> None:
    """UG p. 95 for the style; that RS-232 has it too is inferred."""
    async with recorded() as (drive, _, wire):
        await drive.command("N005: POSA 250")
        assert await drive.query("N5") == "N005: POSA 250"
        await drive.command("N001: END")
        assert wire.take() == conversation(
            b"N005: POSA 250\r", PROMPT,
            b"N5\r", b"N005: POSA 250\r\n>",
            b"N001: END\r", PROMPT,
        )  # fmt: skip


PROGRAM = """\
N001: ACCEL 250
N002: SPEED 80
N003: REPEAT 10
N004: IF I7=1 GOTO 9
N005: WAIT 100
N006: END
N007: OUTPUT O7=1
N008: GOTO 13
N009: POSA 1250
N010: OUTPUT O8=1
N011: WAIT 500
N012: OUTPUT O8=0
N013: END
"""


async def test_the_program_of_the_manual_goes_over_the_line_as_it_is_printed() -> None:
    """UG p. 95."""
    async with recorded() as (drive, _, wire):
        for line in wire_lines(parse(PROGRAM)):
            await drive.command(line)
        written = wire.take()
        read = [await drive.query(f"N{number}") for number in range(1, 14)]
        assert [data for direction, data in written if direction == "->"] == [
            line.encode() + b"\r" for line in PROGRAM.splitlines()
        ]
        assert {data for direction, data in written if direction == "<-"} == {PROMPT}
        assert read == PROGRAM.splitlines()


async def test_the_minimal_conversation() -> None:
    """Synchronise, password, speed, ramps, a move with its message, the position on the way, the history."""
    async with recorded(answer_time_s=0) as (drive, far, wire):
        assert await drive.query("S17") == "S017: 00000010"
        await drive.command("GOTO 302")
        await drive.command("SD 50")
        await drive.command("AL 250")
        move = drive.move_to(1000)
        await move.accepted
        # 100 mm/s after a ramp of 125 ms, which costs half of its time, and 1 ms behind.
        await asyncio.sleep(4.1872)
        assert await drive.query("S1") == "S001: 412.37"
        assert (await move).confirmed_by == "message"
        assert wire.take() == conversation(
            b"S17\r", b"S017: 00000010\r\n>",
            b"GOTO 302\r", PROMPT,
            b"SD 50\r", PROMPT,
            b"AL 250\r", PROMPT,
            b"PA1000$\r", PROMPT,
            b"S1\r", b"S001: 412.37\r\n>$\r\n>",
        )  # fmt: skip
        assert far.position == 1000


async def test_a_positioning_during_a_move_gets_e92() -> None:
    """UG p. 162, 209: somebody else moves the drive; what we send is refused, and once is enough."""
    async with recorded() as (drive, far, wire):
        strangers_order(far, "PA100")
        await asyncio.sleep(0.1)  # in which its prompt comes, and the line is brought in step again
        with pytest.raises(compax_aio.CommandRejectedError) as caught:
            await drive.move_to(5)
        assert caught.value.code == 92
        sent = [data for direction, data in wire.take() if direction == "->" and data.startswith(b"PA")]
        assert sent == [b"PA5$\r"]
        await asyncio.sleep(5)


@pytest.mark.parametrize(("lines", "seconds"), [(["AL 1000"], 2.0), (["AL 1000", "AL- 500"], 1.75)])
async def test_without_a_time_of_its_own_braking_takes_that_of_accel(lines: list[str], seconds: float) -> None:
    """IBS p. 48: ACCEL is the time from 0 to nominal speed, 200 mm/s here, and back unless ACCEL- says another."""
    async with recorded(answer_time_s=0) as (drive, _, _):
        for line in lines:
            await drive.command(line)
        result = await drive.move_to(200)
        assert result.duration_s == pytest.approx(seconds, abs=0.01)


# Binary transfer ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "as_sent"),
    [
        (10, "0000000A0000"),
        (360, "000000680100"),
        (450.5, "000080C20100"),
        (-1, "000000FFFFFF"),
        (-450.5, "0000803DFEFF"),
    ],
)
def test_the_numbers_of_the_manual_in_binary(value: float, as_sent: str) -> None:
    """UG p. 167; -450.5 is computed by the same rule."""
    assert encode_number(value) == bytes.fromhex(as_sent)
    assert decode_number(bytes.fromhex(as_sent)) == value


@pytest.mark.parametrize(("line", "as_sent"), [("POSA 360.0", "8841000000680100"), ("ACCEL 250", "844C00FA")])
def test_the_frame_that_the_manual_spells_out(line: str, as_sent: str) -> None:
    """UG p. 167; that of ACCEL is computed by the same rule."""
    assert encode_frame(line) == bytes.fromhex(as_sent)

"""A link that speaks the protocol, and a simulated control at its far end: programs both ways, in all four modes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import pytest

from compax_aio.errors import AnswerTimeoutError, UnexpectedAnswerError
from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM, Profile
from compax_aio.haas.protocol import HaasProtocol
from compax_aio.haas.protocol_events import Answered, NobodyAnswers, Printed, TransferOver
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfers.account import Ending, LineAccount
from compax_aio.haas.transfers.choosing import drip_feed, receive_file, send_file
from compax_aio.haas.transfers.strategy import Patience, Strategy
from compax_aio.link.contract import Event, Lane, TurnOver
from compax_aio.link.level import LineLevel
from compax_aio.link.link import Link
from compax_aio.simulator.haas import Knobs, SimulatedControl
from compax_aio.simulator.server import control_named

MODES = {
    "rts/cts": CLASSIC_RTS_CTS,
    "xon/xoff": CLASSIC,
    "dc codes": CLASSIC_DC_CODES,
    "xmodem": CLASSIC_XMODEM,
}
PATIENCE = Patience()
_numbers = count()


@dataclass
class Pair:
    """The near end and the far end."""

    link: Link
    protocol: HaasProtocol
    far: SimulatedControl
    profile: Profile
    events: list[Event] = field(default_factory=list)

    async def transfer(self, strategy: Strategy) -> LineAccount:
        self.protocol.load(strategy)
        outcome = await self.link.exchange(strategy.label, Lane.CONTROL)
        assert isinstance(outcome, TransferOver)
        return outcome.account

    async def receive(self, what: str, *, after_s: float = 1.0) -> tuple[bytes, LineAccount]:
        pieces: list[bytes] = []
        strategy = receive_file(
            self.mode, "receive", pieces.append, patience=PATIENCE, max_bytes=1 << 26, eob=self.profile.eob_bytes
        )
        asyncio.get_running_loop().call_later(after_s, self.far.press_send, what)
        account = await self.transfer(strategy)
        return b"".join(pieces), account

    async def send(self, data: bytes, *, what: str = "programs") -> tuple[LineAccount, Strategy]:
        strategy = send_file(self.mode, "send", data, patience=PATIENCE, eob=self.profile.eob_bytes)
        self.far.press_recv(what)
        return await self.transfer(strategy), strategy

    async def ask(self, text: str) -> TurnOver:
        return await self.link.exchange(text, Lane.READ)

    @property
    def mode(self) -> str:
        assert self.profile.synchronization is not None
        return self.profile.synchronization


@asynccontextmanager
async def pair(profile: Profile, baudrate: Any = 9600, **knobs: Any) -> AsyncIterator[Pair]:
    name = f"protocol and control {next(_numbers)}"
    sets = {"xmodem": "xmodem"}.get(str(profile.synchronization), "classic")
    far = control_named(
        name,
        Knobs(profile=sets, synchronization=str(profile.synchronization), baudrate=baudrate, **knobs),
    )
    events: list[Event] = []
    protocol = HaasProtocol(profile, ControlSettings())
    link = Link(
        protocol,
        name="control",
        answer_timeout_s=2.0,
        resync_attempts=5,
        on_event=events.append,
        on_lost=lambda _: None,
    )
    link.bytes_per_s = baudrate / far.knobs.byte_bits
    protocol.level = LineLevel(link.bytes_per_s, lambda: link.unsent_bytes)
    await link.open(f"sim://haas?name={name.replace(' ', '%20')}")
    try:
        yield Pair(link, protocol, far, profile, events)
    finally:
        await link.close()


def program(lines: int, eob: bytes, name: str = "O00777") -> bytes:
    blocks = [
        b"%",
        name.encode(),
        *(b"N%d G01 X%d.125 Y-3.5" % (n, n % 100) for n in range(1, lines + 1)),
        b"M30",
        b"%",
    ]
    return eob.join([*blocks, b""])


def stored(far: SimulatedControl, name: str = "O00777") -> list[str]:
    return far.memory.programs[name].replace(" ", "").strip().split("\n")


LINES_OF_200_KB = 8500


@pytest.mark.parametrize("mode", MODES)
async def test_a_program_of_200_kb_goes_to_the_control_and_comes_back(mode: str) -> None:
    profile = MODES[mode]
    data = program(LINES_OF_200_KB, profile.eob_bytes)
    assert 190_000 < len(data) < 230_000
    loop = asyncio.get_running_loop()
    async with pair(profile) as ends:
        began_s = loop.time()
        account, strategy = await ends.send(data)
        took_s = loop.time() - began_s
        assert account.ending is Ending.COMPLETE
        assert account.bytes == len(data)
        assert account.lines == data.count(profile.eob_bytes)
        wanted = {"dc codes": "reader off seen", "xmodem": "xmodem acknowledged"}.get(mode, "left the line")
        assert strategy.proof == wanted
        assert ends.far.screen == "RS232 DONE"
        assert stored(ends.far) == data.decode().replace(" ", "").split("%")[1].split()
        rate = ends.link.bytes_per_s
        assert rate is not None
        assert took_s < len(data) / rate * 1.12 + 8

        began_s = loop.time()
        text, received = await ends.receive("O00777")
        took_s = loop.time() - began_s
        assert received.ending is Ending.COMPLETE
        assert received.is_closed
        assert received.damaged_bytes == 0
        assert text.replace(b" ", b"").split() == data.replace(b" ", b"").split()
        assert (received.has_dc2, received.has_dc4) == ((mode == "dc codes",) * 2)
        assert took_s < len(text) / rate * 1.12 + 8


@pytest.mark.parametrize("mode", MODES)
async def test_a_slow_control_loses_nothing(mode: str) -> None:
    profile = MODES[mode]
    data = program(150, profile.eob_bytes)
    async with pair(profile, take_bytes_s=300.0) as ends:
        account, _ = await ends.send(data)
        await asyncio.sleep(5)
        assert account.ending is Ending.COMPLETE
        assert not ends.far.alarms
        assert stored(ends.far) == data.decode().replace(" ", "").split("%")[1].split()
        if mode in {"xon/xoff", "dc codes"}:
            assert account.holds > 5
            assert account.most_held_bytes <= 16


@pytest.mark.parametrize("mode", ["rts/cts", "xon/xoff", "dc codes"])
async def test_a_drip_feed_is_run_as_it_comes(mode: str) -> None:
    profile = MODES[mode]
    data = program(60, profile.eob_bytes)
    async with pair(profile, dnc_block_s=2.0) as ends:
        ends.far.press_dnc()
        began_s = asyncio.get_running_loop().time()
        account = await ends.transfer(
            drip_feed(mode, "drip", data, patience=PATIENCE, eob=profile.eob_bytes, waits_for_start=False)
        )
        assert account.ending is Ending.COMPLETE
        assert account.bytes == len(data)
        assert asyncio.get_running_loop().time() - began_s > 50
        await asyncio.sleep(60)
        assert not ends.far.alarms


@pytest.mark.parametrize("mode", MODES)
async def test_a_sending_that_is_given_up_leaves_the_line_usable(mode: str) -> None:
    profile = MODES[mode]
    data = program(400, profile.eob_bytes)
    async with pair(profile) as ends:
        strategy = send_file(mode, "send", data, patience=PATIENCE, eob=profile.eob_bytes)
        ends.far.press_recv()
        sending = asyncio.ensure_future(ends.transfer(strategy))
        await asyncio.sleep(3)
        in_step = ends.link.preempt("send")
        account = await sending
        assert account.ending is Ending.GIVEN_UP
        assert 0 < account.bytes < len(data)
        await in_step
        went = ends.far.received_bytes
        await asyncio.sleep(10)
        assert ends.far.received_bytes == went
        ends.far.press_reset()
        again, _ = await ends.send(program(5, profile.eob_bytes))
        assert again.ending is Ending.COMPLETE
        assert len(stored(ends.far)) == 7


@pytest.mark.parametrize("mode", MODES)
async def test_a_reception_that_is_given_up_leaves_the_line_usable_when_the_control_is_through(mode: str) -> None:
    profile = MODES[mode]
    async with pair(profile, program_blocks=1000) as ends:
        receiving = asyncio.ensure_future(ends.receive("O00010", after_s=0))
        await asyncio.sleep(4)
        in_step = ends.link.preempt("receive")
        text, account = await receiving
        assert account.ending is Ending.GIVEN_UP
        assert 0 < len(text) == account.bytes
        ends.far.press_reset()
        await in_step
        text, account = await ends.receive("O01234")
        assert account.ending is Ending.COMPLETE
        assert b"O01234" in text


async def test_a_control_that_sends_and_sends_is_told_when_a_question_is_asked() -> None:
    async with pair(CLASSIC, program_blocks=4000) as ends:
        ends.far.press_send("O00010")
        await asyncio.sleep(1)
        in_step = ends.link.preempt("nothing")
        with pytest.raises(UnexpectedAnswerError, match="nobody has waited for it"):
            await in_step
        ends.far.press_reset()
        assert await ends.ask("Q100") == Answered("S/N, 1234567")


async def test_questions_and_files_take_turns_and_prints_are_told() -> None:
    async with pair(CLASSIC) as ends:
        assert await ends.ask("Q100") == Answered("S/N, 1234567")
        receiving = asyncio.ensure_future(ends.receive("O01234"))
        await asyncio.sleep(0)
        asking = asyncio.ensure_future(ends.ask("Q201"))
        text, _ = await receiving
        assert b"O01234" in text
        assert isinstance(await asking, Answered)
        ends.far.dprnt("PART*7")
        await asyncio.sleep(1)
        assert [each for each in ends.events if isinstance(each, Printed)] == [Printed("PART 7")]


async def test_a_control_that_collects_no_data_takes_files_all_the_same() -> None:
    async with pair(CLASSIC, data_collection="off") as ends:
        with pytest.raises(AnswerTimeoutError):
            await ends.ask("Q500")
        assert isinstance(await ends.ask("Q500"), NobodyAnswers)
        text, account = await ends.receive("O01234")
        assert account.ending is Ending.COMPLETE
        assert b"\x02" not in text


@pytest.mark.parametrize("seed", range(8))
async def test_answers_that_are_late_lost_or_doubled_are_never_anothers(seed: int) -> None:
    chances: dict[str, Any] = {"late_reply": 0.2, "lose_reply": 0.1, "double_reply": 0.1}
    answered = 0
    async with pair(CLASSIC, seed=seed, late_s=3.0, **chances) as ends:
        for number in (1, 5, 9, 13, 17, 21, 25, 29) * 3:
            ends.far.memory.macros[number] = float(number)
            try:
                answer = await ends.ask(f"Q600 {number}")
            except AnswerTimeoutError:
                continue
            if isinstance(answer, Answered):
                answered += 1
                assert answer.text.replace(" ", "") == f"MACRO,{number},{number}.0000"
    assert answered > 5


@pytest.mark.parametrize("mode", ["xon/xoff", "rts/cts"])
async def test_parity_in_the_bytes_finds_each_damaged_byte_of_a_file(mode: str) -> None:
    profile = replace(MODES[mode], parity_in="bytes")
    async with pair(profile, parity_in_bytes=True, spoil_sent=0.01, seed=3, program_blocks=100) as ends:
        text, account = await ends.receive("O00010")
        assert account.damaged_bytes > 5
        assert len(account.damage_offsets) == account.damaged_bytes
        assert all(offset < len(text) for offset in account.damage_offsets)
    async with pair(profile, parity_in_bytes=True, program_blocks=100) as ends:
        data = program(50, profile.eob_bytes)
        account, _ = await ends.send(data)
        assert not ends.far.alarms
        assert stored(ends.far) == data.decode().replace(" ", "").split("%")[1].split()

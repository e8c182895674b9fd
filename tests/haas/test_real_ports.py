"""Over a port of the kernel, in real time, files go as they do in memory; the port is opened as the profile says."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest
from tests.haas.bench import MODES, program_of, text_of

from compax_aio.haas.connecting import connect
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.haas import Knobs, SimulatedControl
from compax_aio.simulator.line import DeviceLine
from compax_aio.simulator.pseudo_terminal import PseudoTerminal

pytestmark = pytest.mark.real_time

SETTINGS = ControlSettings(tail_s=0.3, block_timeout_s=0.5)


@pytest.mark.parametrize("mode", MODES)
async def test_a_program_goes_both_ways_over_a_pseudo_terminal(mode: str) -> None:
    profile = replace(MODES[mode], baudrate=115200)
    knobs = Knobs.named(
        "classic", synchronization=mode, baudrate=115200, parity=profile.parity, data_bits=profile.data_bits,
        stop_bits=profile.stop_bits, eob=profile.eob, add_spaces="off", nak_every_s=0.1,
    )  # fmt: skip
    far = SimulatedControl(knobs)
    port = PseudoTerminal(DeviceLine.of(far))
    text = program_of(3000)
    far.memory.programs["O01234"] = text
    try:
        async with asyncio.timeout(60), connect(f"serial://{port.path}", profile=profile, settings=SETTINGS) as control:
            transfer = control.receive_program()
            asyncio.get_running_loop().call_later(0.4, far.press_send, "O01234")
            received = await transfer
            assert text_of(received.data) == text
            assert received.damage is None or mode == "xmodem"  # a pseudo-terminal counts nothing
            far.memory.programs.clear()
            far.press_recv()
            await control.send_program(text)
            while far.doing != "nothing":  # noqa: ASYNC110
                await asyncio.sleep(0.02)
            assert far.memory.programs == {"O01234": text}
            assert not far.alarms
    finally:
        port.close()

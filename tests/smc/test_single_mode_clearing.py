"""In single mode what was typed is taken back before anything else is said, with all that was damaged on the way."""

from __future__ import annotations

import asyncio

import pytest

from compax_aio import smc
from compax_aio.errors import CompaxError
from compax_aio.simulator.server import serve_loopback
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine


async def test_a_motion_whose_terminator_became_a_character_is_taken_back_to_its_first_letter() -> None:
    far = SimulatedPartyLine(Knobs(mode="single", position=500.0))
    settings = smc.SmcSettings(echo_timeout_s=0.1, answer_timeout_s=0.5)
    async with (
        serve_loopback(far, "single") as url,
        smc.connect(url, mode="single", settings=settings) as line,
    ):
        move = line.axis().move_to(-1004)
        while far.log.texts(LogKind.RECEIVED)[-6:] != [f"{ord(each):02X}" for each in "R-1004"]:  # noqa: ASYNC110
            await asyncio.sleep(0.00005)
        far.flip_next_character(6)
        with pytest.raises(CompaxError):
            await move
        assert not far.log.texts(LogKind.MOTION_STARTED)
        assert far.axes["A"].position == 500.0

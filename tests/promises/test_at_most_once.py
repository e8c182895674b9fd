"""P2 and P3: whatever the line does, a motion is started at most once, and what the caller is told of it is true."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.promises.bench import bench, lines, motions, now

from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    Drive,
    DriveSettings,
    Move,
    MoveInDoubtError,
    MoveResult,
    MoveTimeoutError,
)
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import LogKind, SimulatedDrive

LONGEST_S = 200.0
"""Three moves, each with patience for 5 s of doubt, an answer time-out and three markers of 1 s now and then."""


@dataclass(frozen=True)
class Trouble:
    """Something that befalls the line for a while."""

    at_s: float
    kind: str
    amount: float

    async def befall(self, far: SimulatedDrive) -> None:
        await asyncio.sleep(self.at_s)
        match self.kind:
            case "deaf" | "silent":
                setattr(far, self.kind, True)
                await asyncio.sleep(self.amount)
                setattr(far, self.kind, False)
            case "late answers":
                far.extra_answer_delay_s = self.amount
                await asyncio.sleep(2 * self.amount)
                far.extra_answer_delay_s = 0
            case "lost answers":
                far.lose_answers += int(self.amount) + 1
            case "lost $":
                far.lose_position_reached += 1
            case "late $":
                far.delay_position_reached_s = self.amount
            case "noise":
                far.inject((b"\x00\xff", b"\r\n>", b"$\r", b"S00", b"\xa5?")[int(self.amount)])


TROUBLES = st.builds(
    Trouble,
    at_s=st.one_of(st.floats(0, 0.05), st.floats(0, 6)).map(lambda t: round(t, 4)),
    kind=st.sampled_from(["deaf", "silent", "late answers", "lost answers", "lost $", "late $", "noise"]),
    amount=st.one_of(st.floats(0, 0.01), st.floats(0, 4.9)).map(lambda t: round(t, 4)),
)

MOVES: list[tuple[Callable[[Drive], Move], str]] = [
    (lambda drive: drive.move_to(31.5), "PA31.5"),
    (lambda drive: drive.move_by(417.25, speed_percent=90), "PR417.25"),
    (lambda drive: drive.move_to(-12.75, comparators=[(20, 1)]), "PA-12.75"),
]


async def carry_out(troubles: list[Trouble], form: str) -> None:
    told: list[tuple[str, Move | None, MoveResult | CompaxError, float]] = []
    async with bench(position_reached=form, settings=DriveSettings(in_doubt_after_s=5)) as (drive, far):
        work = [asyncio.ensure_future(trouble.befall(far)) for trouble in troubles]
        for start, text in MOVES:
            move: Move | None = None
            outcome: MoveResult | CompaxError
            try:
                move = start(drive)
                outcome = await move
            except CompaxError as error:
                outcome = error
            told.append((text, move, outcome, far.position))
            if isinstance(outcome, MoveInDoubtError):
                await asyncio.gather(*work)
                await reconciled(drive)
        assert now() < LONGEST_S
        await asyncio.gather(*work)
        far.lose_answers = 0
        await asyncio.sleep(30)
    for text, move, outcome, position_then in told:
        check(far, text, move, outcome, position_then)


async def reconciled(drive: Drive) -> None:
    for _ in range(10):
        try:
            await drive.reconcile()
        except CompaxError:
            continue
        return


def check(
    far: SimulatedDrive, text: str, move: Move | None, outcome: MoveResult | CompaxError, position_then: float
) -> None:
    """Compare what was told with what the far end has done."""
    said = [line for line in lines(far) if line.removesuffix("$") == text]
    word = "POSR" if text.startswith("PR") else f"POSA {float(text[2:]):.2f}"
    started = [motion for motion in motions(far) if motion.startswith(word)]
    story = f"{text}: {outcome!r}, {outcome}; the far end has {[str(entry) for entry in far.log]}"
    assert len(said) <= 1, story
    assert len(started) <= 1, story
    if isinstance(outcome, MoveResult):
        assert started, story
        assert position_then == outcome.target, story
        assert f"{position_then:.2f}" in far.log.texts(LogKind.MOTION_REACHED), story
    elif move is None or move.sent is None:
        # Refused, or its preparation failed.
        assert not said, story
    elif isinstance(outcome, CommandRejectedError) or "was not taken" in str(outcome):
        assert not started, story
    elif not isinstance(outcome, MoveInDoubtError):
        assert not started, story
        assert isinstance(outcome, AnswerTimeoutError | MoveTimeoutError), story
        assert outcome.sent is not None, story


@given(st.lists(TROUBLES, max_size=5), st.sampled_from(["prompt_first", "final_only"]))
@settings(suppress_health_check=[HealthCheck.too_slow])
def test_three_moves_on_a_line_in_trouble_are_started_at_most_once_and_told_truly(
    troubles: list[Trouble], form: str
) -> None:
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(carry_out(troubles, form))

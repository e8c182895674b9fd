"""The conversations of the torture, and what is said of them: who got whose answer."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final

from .torture_far_end import FarEnd, Question, on_port, on_tcp
from .torture_peers import Client, Peer

__all__ = [
    "LATE_S",
    "NAMED",
    "TIMEOUT_S",
    "UNNAMED",
    "Conversation",
    "Outcome",
    "Questions",
    "Write",
    "ask_late",
    "cancel_a_caller",
    "write_unanswered",
]

TIMEOUT_S: Final = 0.25
"""What every peer is told to wait for an answer."""

LATE_S: Final = 1.7 * TIMEOUT_S
"""What the answer to question A takes, whenever it is asked: so late that B is waiting already, and goes on waiting."""

CANCELLED_AT_S: Final = 0.25 * TIMEOUT_S
ANSWERED_AT_S: Final = 0.75 * TIMEOUT_S
"""When a caller is cancelled, and when his answer comes: in time, had he waited."""

_SETTLED_S: Final = 0.05
_HUNG_S: Final = 12 * TIMEOUT_S

Questions = tuple[Question, Question, Question]

NAMED: Final[Questions] = (
    Question(name="A", line="S1", answer="S001: 101.00", register=1, value=101),
    Question(name="B", line="S3", answer="S003: 202.00", register=3, value=202),
    Question(name="C", line="S4", answer="S004: 303.00", register=4, value=303),
)
"""Status queries: a COMPAX answers with number and value."""

UNNAMED: Final[Questions] = (
    Question(name="A", line="SD10", answer="", register=1, value=0),
    Question(name="B", line="SD20", answer="E90", register=3, value=0),
    Question(name="C", line="SD30", answer="", register=4, value=0),
)
"""Commands, whose answers say nothing of what they answer: a prompt alone accepts A and C, an error refuses B."""

_MOVE: Final = Question(name="move", line="PA100", answer="", register=9, value=100, writes=True)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a caller got for one question: a text, or the name of the error raised."""

    question: Question
    answer: str | None = None
    error: str | None = None

    @property
    def is_foreign(self) -> bool:
        """Whether it is an answer, and not the one to this question."""
        return self.answer is not None and not self.question.owns(self.answer)


@dataclass(frozen=True, slots=True)
class Conversation:
    """What the callers got, one after the other; *questions* are all that the far end was asked."""

    questions: Questions
    outcomes: tuple[Outcome, ...]

    @property
    def verdict(self) -> str:
        """Judge it. The first question may fail, it was late; the others were answered in good time."""
        if any(each.is_foreign for each in self.outcomes):
            return "shifted"
        if any(each.error for each in self.outcomes if each.question != self.questions[0]):
            return "error"
        return "right"

    def told(self) -> list[str]:
        """Say what each caller got."""
        return [self._told(each) for each in self.outcomes]

    def _told(self, outcome: Outcome) -> str:
        if outcome.answer is None:
            return str(outcome.error)
        if not outcome.is_foreign:
            return "its own"
        owner = next((each.name for each in self.questions if each.owns(outcome.answer)), None)
        return f"answer to {owner}" if owner else f"nobody's: {outcome.answer!r}"


@dataclass(frozen=True, slots=True)
class Write:
    """How often an order went out that is never answered, and what its caller was told."""

    frames: int
    told: str


async def ask_late(peer: Peer, questions: Questions = NAMED, *, pauses: bool = False) -> Conversation:
    """Ask all in turn; the first answer is late. With *pauses* nothing is asked until everything has been said."""
    async with _line(peer, questions) as (far_end, client):
        late, *others = questions
        far_end.slow[late.name] = LATE_S
        outcomes = [await _asked(client, late)]
        if pauses:
            await asyncio.sleep(far_end.idle_at - asyncio.get_running_loop().time() + _SETTLED_S)
        outcomes += [await _asked(client, each) for each in others]
    return Conversation(questions, tuple(outcomes))


async def cancel_a_caller(peer: Peer, questions: Questions = NAMED) -> Conversation:
    """Cancel the caller of the first question before its answer comes, and ask the others at once."""
    async with _line(peer, questions) as (far_end, client):
        abandoned, *others = questions
        far_end.slow[abandoned.name] = ANSWERED_AT_S
        caller = asyncio.create_task(client.ask(abandoned))
        await asyncio.sleep(CANCELLED_AT_S)
        caller.cancel()
        await asyncio.wait([caller])
        outcomes = [await _asked(client, each) for each in others]
    return Conversation(questions, tuple(outcomes))


async def write_unanswered(peer: Peer) -> Write:
    """Order a motion that is never answered, and count how often the far end is told to."""
    async with _line(peer, (_MOVE,)) as (far_end, client):
        far_end.deaf.add(_MOVE.name)
        outcome = await _asked(client, _MOVE)
        return Write(far_end.times_asked(_MOVE), outcome.error or "done")


@asynccontextmanager
async def _line(peer: Peer, questions: tuple[Question, ...]) -> AsyncIterator[tuple[FarEnd, Client]]:
    far_end = FarEnd(peer.dialect, questions, forgets_closed=peer.forgets_closed)
    async with (on_port if peer.on_port else on_tcp)(far_end) as where:
        client = await peer.open(where, TIMEOUT_S)
        try:
            yield far_end, client
        finally:
            await client.close()


async def _asked(client: Client, question: Question) -> Outcome:
    limit = asyncio.timeout(_HUNG_S)
    try:
        async with limit:
            return Outcome(question, answer=await client.ask(question))
    except Exception as error:  # whatever a peer raises is what its caller gets
        return Outcome(question, error="hung" if limit.expired() else type(error).__name__)

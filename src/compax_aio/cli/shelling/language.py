"""A typed line understood: the drive's own language, or a word of the shell; refused before anything is sent."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from rich.text import Text

from ...compax.drive import Drive
from ...compax.plain_line import check_line, is_query, starts_motion
from ...compax.value_tables import PARAMETER_TABLE
from ...compax.vocabulary import MovePlan, plan_home, plan_move_by, plan_move_to
from ...errors import (
    CommandRejectedError,
    CompaxError,
    InvalidCommandError,
    MoveStoppedError,
    UnexpectedAnswerError,
)
from ...escaping import escaped, shown
from ..number_words import number_of
from .decoding import answered, bits_note, error_note
from .entries import Kind
from .explaining import explained, overview
from .replies import Reply
from .underway import Underway
from .vocabulary import Vocabulary
from .words import WORDS

__all__ = ["Language", "Order"]

_POSITIONING: Final = re.compile(r"(POSA|PA|POSR|PR)([-+]?(?:\d+\.?\d*|\.\d+))")
_POWER: Final = re.compile(r"(OUTPUT|OT)O0=")
_NUMBERS: Final = re.compile(r"[Pp]?(\d{1,3})(?:-[Pp]?(\d{1,3}))?")
_MOVE_FORM: Final = "move 100, move by -5, move 100 at 20"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One line that was understood."""

    text: str
    carry_out: Callable[[], Awaitable[Reply]]
    can_move: bool = False
    """Whether it can set the axis in motion, a load that hangs on it included."""
    is_stop: bool = False
    """Whether it waits for nothing."""
    is_said: bool = True
    """Whether anything goes over the line, so that it has to wait for its turn."""


class Language:
    """
    What can be said to one drive.

    Args:
        drive: Of which lines are asked.
        underway: Takes note of what may be moving.
    """

    def __init__(self, drive: Drive, underway: Underway) -> None:
        self.vocabulary = Vocabulary(drive.settings, WORDS)
        self._drive = drive
        self._underway = underway
        self._words: dict[str, Callable[[str, list[str]], Order]] = {
            "move": self._move,
            "home": self._home,
            "stop": self._stop,
            "status": partial(self._plain, self._status),
            "error": partial(self._plain, self._error),
            "history": partial(self._plain, partial(self._say_raw, "S18")),
            "quit": partial(self._plain, self._quit),
            "reconcile": partial(self._plain, self._reconcile),
            "params": self._params,
            "help": self._help,
            "raw": lambda text, words: self._raw(text, text.split(maxsplit=1)[1] if words else ""),
        }

    def understand(self, text: str) -> Order:
        """
        Return what *text* orders; nothing is sent before that is carried out.

        Raises:
            InvalidCommandError: It is nothing that the drive, or this shell, can be told.
        """
        text = text.strip(" \t")
        word, *words = text.split() or [""]
        if (make := self._words.get(word.lower())) is not None:
            return make(text, words)
        if text.endswith("$"):
            return self._awaited(text)
        line = check_line(text)
        found = self.vocabulary.find(line)
        if found and found[0].kind == Kind.ERROR:
            return self._help(text, [line])
        if not found:
            raise InvalidCommandError(
                f"{shown(text)} is no word of this shell, and begins with nothing that the tables of the drive have",
                hint=f"`help` says what there is; `raw {escaped(text)}` sends it all the same",
            )
        return self._raw(text, line)

    # The drive's own language ---------------------------------------------------------------------------------------

    def _raw(self, text: str, rest: str) -> Order:
        line = check_line(rest).upper()
        dialect = self._drive.settings.dialect
        compact = line.replace(" ", "")
        if compact == dialect.stop.replace(" ", "").upper():
            return self._stop(text, [])
        if starts_motion(line, dialect.motions):
            return Order(text=text, carry_out=partial(self._start_raw, line), can_move=True)
        return Order(text=text, carry_out=partial(self._say_raw, line), can_move=_POWER.match(compact) is not None)

    def _awaited(self, text: str) -> Order:
        """Understand a positioning with ``$``: a move, whose end is told."""
        compact = text[:-1].replace(" ", "").upper()
        if compact in {"POSAHOME", "PH"}:
            return self._home(text, [])
        match = _POSITIONING.fullmatch(compact)
        if match is None:
            raise InvalidCommandError(
                f"$ stands behind POSA or POSR and a number (UG p. 160), not behind {shown(text[:-1])}",
                hint="leave it out, or use move",
            )
        plan = plan_move_to if match[1] in {"POSA", "PA"} else plan_move_by
        return self._planned(text, plan(float(match[2]), self._drive.settings))

    async def _say_raw(self, line: str) -> Reply:
        try:
            answer = await self._drive.command(line)
        except UnexpectedAnswerError as error:
            if error.received is None or is_query(line):
                raise
            return Reply(
                data={"answer": error.received, "was_expected": False},
                people=Text.assemble(
                    (escaped(error.received), "bold"),
                    ("   a bare prompt was expected: whether the drive has carried it out is not known", "yellow"),
                ),
            )
        return answered(line, answer, self._drive.settings) if is_query(line) else self._acknowledged()

    async def _start_raw(self, line: str) -> Reply:
        before = self._underway.unseen
        self._underway.note_unseen(line, self._now())
        try:
            await self._drive.command(line)
        except (InvalidCommandError, MoveStoppedError, CommandRejectedError):
            self._underway.unseen = before  # it was not sent, or not taken
            raise
        self._underway.note_unseen(line, self._now())
        return self._acknowledged("it may be moving now, and nobody is told when it is there; `move` tells")

    def _acknowledged(self, more: str = "") -> Reply:
        people = Text.assemble((">", "bold green"), "  the drive has taken it", ("; " + more if more else "", "dim"))
        return Reply(data={"answer": ""}, people=people)

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    # Motion ---------------------------------------------------------------------------------------------------------

    def _move(self, text: str, words: list[str]) -> Order:
        rest = [each.lower() for each in words]
        is_relative = rest[:1] == ["by"]
        numbers = rest[1:] if is_relative else rest
        match numbers:
            case [where]:
                speed = None
            case [where, "at", percent]:
                speed = _number(percent, "a speed in %")
            case _:
                raise InvalidCommandError(f"{shown(text)} is no move", hint=f"one of: {_MOVE_FORM}")
        plan = plan_move_by if is_relative else plan_move_to
        number = _number(where, "a position or distance")
        return self._planned(text, plan(number, self._drive.settings, speed_percent=speed))

    def _home(self, text: str, words: list[str]) -> Order:
        _expect_no_more(text, words)
        return self._planned(text, plan_home(self._drive.settings))

    def _planned(self, text: str, plan: MovePlan) -> Order:
        return Order(text=text, carry_out=partial(self._begin, plan), can_move=True)

    async def _begin(self, plan: MovePlan) -> Reply:
        move = self._drive.start(plan)
        self._underway.move = move
        try:
            await move.accepted
        except asyncio.CancelledError:
            move.cancel()
            raise
        to = f"to {self._written(move.target)}" if move.target is not None else move.description
        return Reply(
            data={"accepted": True, "sent": move.sent},
            people=Text.assemble((">", "bold green"), f"  on its way {to}"),
            move=move,
        )

    def _stop(self, text: str, words: list[str]) -> Order:
        _expect_no_more(text, words)
        return Order(text=text, carry_out=self._stop_and_say, is_stop=True)

    async def _stop_and_say(self) -> Reply:
        await self.stop()
        return await self.stopped()

    async def stop(self) -> None:
        """Stop the axis; raises as ``Drive.stop`` does."""
        try:
            await self._drive.stop()
        except CompaxError:
            self._underway.note_unseen("what was not stopped", self._now())
            raise
        self._underway.note_standstill()

    async def stopped(self) -> Reply:
        """Say, after a stop, where the axis stands."""
        try:
            position: float | None = await self._drive.position()
        except CompaxError:
            position = None  # that it stands is known all the same
        where = f" at {self._written(position)}" if position is not None else ""
        return Reply(
            data={"stopped": True, "position": position, "unit": self._drive.unit},
            people=Text.assemble(("stopped  ", "bold yellow"), f"the drive has acknowledged STOP and stands{where}"),
        )

    def _written(self, position: float) -> str:
        return f"{position:.{self._drive.settings.decimals}f} {self._drive.unit}"

    # Looking --------------------------------------------------------------------------------------------------------

    def _plain(self, carry_out: Callable[[], Awaitable[Reply]], text: str, words: list[str]) -> Order:
        _expect_no_more(text, words)
        return Order(text=text, carry_out=carry_out)

    async def _status(self) -> Reply:
        at = self._now()
        status = await self._drive.status()
        self._underway.note_status(status, at)
        position = await self._drive.position()
        error = await self._drive.error()
        settings = self._drive.settings
        people = Text("\n").join(
            (
                Text.assemble(("S16  ", "bold"), status.s16, "   ", bits_note(16, status.s16)),
                Text.assemble(("S17  ", "bold"), status.s17, "   ", bits_note(17, status.s17)),
                Text.assemble(("S1   ", "bold"), self._written(position), "   ", error_note(error)),
            )
        )
        return Reply(
            data={"status": status, "position": position, "unit": settings.unit, "error": error}, people=people
        )

    async def _error(self) -> Reply:
        error = await self._drive.error()
        return Reply(data={"error": error}, people=error_note(error))

    async def _quit(self) -> Reply:
        await self._drive.quit()
        return self._acknowledged("an error that is still present comes back; to leave this shell, type exit")

    async def _reconcile(self) -> Reply:
        at = self._now()
        status = await self._drive.reconcile()
        self._underway.note_status(status, at)
        moving = "a positioning or program runs" if status.command_active or status.program_running else "it stands"
        return Reply(
            data={"status": status},
            people=Text(f"{moving} ({status.as_sent}); the drive takes motion again from here"),
        )

    def _params(self, text: str, words: list[str]) -> Order:
        numbers: list[int] = []
        for word in words:
            match = _NUMBERS.fullmatch(word)
            if match is None:
                numbers = []
                break
            numbers += range(int(match[1]), int(match[2] or match[1]) + 1)
        if not numbers:
            raise InvalidCommandError(f"{shown(text)} names no parameters", hint="one of: params 20, params 11-16")
        names = [PARAMETER_TABLE.name(number) for number in numbers]
        return Order(text=text, carry_out=partial(self._read_all, names))

    async def _read_all(self, names: list[str]) -> Reply:
        known: dict[str, Any] = {}
        lines: list[Text] = []
        for name in names:
            try:
                reply = await self._say_raw(name)
            except CommandRejectedError as error:  # one that this drive does not have is no reason to keep the others
                known[name] = {"error": error}
                lines.append(Text.assemble((name, "bold"), f"   refused with E{error.code}", style="yellow"))
                continue
            known[name] = reply.data
            lines.append(reply.people or Text())
        return Reply(data={"parameters": known}, people=Text("\n").join(lines))

    def _help(self, text: str, words: list[str]) -> Order:
        async def explain() -> Reply:
            return explained(self.vocabulary, " ".join(words)) if words else overview()

        return Order(text=text, carry_out=explain, is_said=False)


def _number(text: str, what: str) -> float:
    try:
        return number_of(text)
    except ValueError:
        hint = "write a point before the decimals" if "," in text else None
        raise InvalidCommandError(f"{shown(text)} is not {what}", hint=hint) from None


def _expect_no_more(text: str, words: list[str]) -> None:
    if words:
        raise InvalidCommandError(f"{shown(text)}: nothing is expected behind {text.split(maxsplit=1)[0]!r}")

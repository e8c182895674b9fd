"""The program in the memory of one axis: listed, written, edited in place or from there on, and run."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from itertools import pairwise

from ..errors import CompaxError, InvalidCommandError, UnexpectedAnswerError
from ..escaping import escaped
from ..link.cancellation import despite_cancellation
from ..link.contract import Lane
from ..motion.moves import OnCancel
from .axis_motion import AxisMotion
from .codecs import Listed, decode_listing
from .moves import AxisMove
from .observer import Observer
from .own_copy import SettingsCopy
from .profile import Profile
from .program_entry import EntryLine, ProgramEntry
from .program_layout import EditPlan, learn_lengths, nv_length
from .program_reports import ProgramReports
from .program_text import check_program, parse_program, plan_edit
from .program_text import instruction as checked
from .vocabulary import list_program, plan_program

__all__ = ["ProgramMemory"]

_log = logging.getLogger("compax_aio.smc")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """What is to be entered, from where on, and how that is ended."""

    address: int
    lines: tuple[EntryLine, ...]
    by_escape: bool = False
    on_progress: Callable[[int, int], None] | None = None


class ProgramMemory:
    """
    The program of one axis; made by :class:`~compax_aio.smc.axis.SmcAxis`.

    While the axis is in program entry (``P``, DCB p. 24) it stores what it is told instead of obeying. So everything
    else for it waits, new motions are refused, and a stop ends the entry before it is sent: within a few commands'
    time. The memory wears out by writing (panther): nothing is written that is there already.

    Args:
        observer: Of the axis.
        motion: Of the axis.
        copy: Of the axis.
    """

    def __init__(self, observer: Observer, motion: AxisMotion, copy: SettingsCopy) -> None:
        self._observer = observer
        self._motion = motion
        self._copy = copy
        self._reports = ProgramReports(observer)

    # Reading --------------------------------------------------------------------------------------------------------

    async def list(self) -> tuple[Listed, ...]:
        """
        List the program (``Q``, DCB p. 24). The line is busy until it is over; ``abort_all()`` alone is heard at once.

        Raises:
            InvalidCommandError: The profile does not know ``Q``; nothing was sent.
            MoveActiveError, MoveInDoubtError: The axis moves, or may, or its program is being written.
            UnexpectedAnswerError: What came is no listing.
        """
        question = list_program(self._profile)
        await self._motion.refuse_if_moving(repr(question))
        return await self._shown(question)

    async def _shown(self, question: str) -> tuple[Listed, ...]:
        line = self._observer.line
        return await line.read(
            self._observer.axis, question, lambda answer: decode_listing(answer.splitlines()), Lane.CONTROL
        )

    # Writing --------------------------------------------------------------------------------------------------------

    async def write(
        self,
        program: str | Iterable[str],
        *,
        at: int = 0,
        verify: bool = True,
        on_progress: Callable[[int, int], None] | None = None,
    ) -> tuple[Listed, ...]:
        """
        Write a program, from the first instruction on that is not there already; each is sent at most once.

        What begins behind its end stays, and the axis may go on with it: whether the end of entry marks the end of a
        program is not documented. The listing that is returned shows it, and a warning in the log.

        Args:
            program: Instructions, a line or an item each; see :func:`parse_program`.
            at: Address of the first one.
            verify: List the program before and after, and compare. Without that everything is written, whatever is
                there, and known is only what the axis acknowledged.
            on_progress: Called after each that was acknowledged, with how many that are, and of how many.

        Returns:
            What the axis lists; without *verify*, what was written.

        Raises:
            InvalidCommandError: It cannot be told to this axis; all errors are in the text. Nothing was sent.
            MoveActiveError, MoveInDoubtError: The axis moves, or may; nothing was written.
            MoveStoppedError: A stop came before anything was written.
            RestoreIncompleteError: It failed, or was stopped, half way, or the axis lists something else; by address,
                what was acknowledged, what was not sent, and what may be stored, in part, or not.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: Nothing was written.
        """
        self._refuse_escapes()
        layout = self._laid_out(program, at)
        question = self._question(verify=verify)
        async with self._session("the program") as entry:
            before = None if question is None else await self._before(question)
            lines = self._lines(layout, before or ())
            start = _first_to_write(lines, before)
            if start is not None:
                address = lines[start].address
                await self._enter(
                    entry,
                    _Work(address=at if address is None else address, lines=lines[start:], on_progress=on_progress),
                )
            if question is None:
                return layout
            shown = await self._verified(question, lines)
        self._warn_of_rest(lines, shown)
        return shown

    async def edit(self, address: int, instruction: str, *, verify: bool = True) -> tuple[Listed, ...]:
        """
        Exchange one instruction, whatever the lengths, so that the others do what they did; jumps follow.

        One of the same length is exchanged alone in single mode, where ESC ends that (AMS p. 25). On a party line ESC
        would abort all axes, and whether ``P0`` in the middle of a program ends it there is not documented: so from
        the first change on, everything is written anew, as if its length was another one.

        Args:
            address: Where it begins, as a listing shows it.
            instruction: What shall stand there; addresses in it are those of the listing as it is now.
            verify: List the program afterwards, and compare.

        Returns:
            What the axis lists, or must list now.

        Raises:
            InvalidCommandError: None begins there, a length is not known, or a jump leads nowhere; nothing was written.
            CompaxError: Otherwise as :meth:`write`.
        """
        self._refuse_escapes()
        wanted = checked(instruction, self._profile)
        question = list_program(self._profile)
        async with self._session("the edit of the program") as entry:
            before = await self._shown(question)
            plan = plan_edit(before, address, wanted, self._profile)
            expected = self._lines(plan.expected, before)
            if all(line.text == line.old for line in expected):
                return before
            await self._enter(entry, self._work_of(plan, expected, before))
            if not verify:
                return plan.expected
            shown = await self._verified(question, expected)
        self._warn_of_rest(expected, shown)
        return shown

    def _work_of(self, plan: EditPlan, expected: Sequence[EntryLine], before: Sequence[Listed]) -> _Work:
        is_alone = not self._observer.line.mode.has_names
        lines = tuple(line for line in expected if line.address is not None and line.address >= plan.address)
        if plan.is_in_place and is_alone:
            return _Work(address=plan.address, lines=lines[:1], by_escape=True)
        _refuse_gaps(lines, before)
        return _Work(address=plan.address, lines=lines)

    def run(self, address: int = 0, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop") -> AxisMove:
        """
        Run the program that begins at *address* (``G``, DCB p. 24); what it sets is not known from here any more.

        The axis may say nothing until its last instruction is done (DCB p. 27).

        Args:
            address: Where it begins.
            timeout_s: When it is stopped; None: never by itself.
            on_cancel: See :meth:`SmcAxis.move_to`.
        """
        move = self._motion.start(plan_program(address, self._profile), timeout_s, on_cancel)
        self._copy.note_program_ran()
        move.add_done_callback(lambda _: self._copy.note_program_ran())
        return move

    # Laying out -----------------------------------------------------------------------------------------------------

    def _laid_out(self, program: str | Iterable[str], at: int) -> tuple[Listed, ...]:
        read = parse_program if isinstance(program, str) else check_program
        layout = tuple(each for each in read(program, self._profile, start=at) if each.text)  # type: ignore[arg-type]
        if not layout:
            raise InvalidCommandError("there is no instruction in the program", device=self._observer.name)
        highest = self._profile.last_program_address
        beyond = [
            each for each in layout if highest is not None and each.address is not None and each.address > highest
        ]
        if beyond:
            raise InvalidCommandError(
                f"{beyond[0].text} would begin at {beyond[0].address}, behind the end of the memory, {highest}",
                device=self._observer.name,
            )
        return layout

    def _question(self, *, verify: bool) -> str | None:
        if not verify:
            return None
        try:
            return list_program(self._profile)
        except InvalidCommandError as error:
            error.hint = f"verify=False writes without looking; {error.hint}"
            raise

    def _refuse_escapes(self) -> None:
        """Refuse to write where trouble with another axis would end the entry of this one without a word."""
        settings = self._observer.line.settings
        if settings.cancel_with == "escape" and self._observer.line.mode.has_names:
            raise InvalidCommandError(
                "no program is written where ESC clears the line (cancel_with): trouble with another axis would end "
                "program entry, and this one would execute the rest",
                device=self._observer.name,
                hint='connect with cancel_with="line feed"',
            )

    def _lines(self, layout: Iterable[Listed], before: Iterable[Listed]) -> tuple[EntryLine, ...]:
        old: dict[int | None, str] = {each.address: each.text for each in before if each.text}
        return tuple(
            EntryLine(each.address, each.text, checked(each.text, self._profile), old.get(each.address))
            for each in layout
        )

    async def _before(self, question: str) -> tuple[Listed, ...] | None:
        """List what is there; None where that is no listing, as in a memory that was never written."""
        try:
            return await self._shown(question)
        except UnexpectedAnswerError:
            return None

    # Entering -------------------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def _session(self, what: str) -> AsyncIterator[ProgramEntry]:
        """Keep motions off, and know of stops, from the first look to the last."""
        entry = ProgramEntry(self._observer)
        await self._motion.begin_programming(what, entry)
        try:
            yield entry
        finally:
            self._motion.end_programming(entry.doubt)

    async def _enter(self, entry: ProgramEntry, work: _Work) -> None:
        """Enter what is to be written, and end the entry, also if the caller is cancelled meanwhile."""

        def on_taken() -> None:
            if work.on_progress is not None:
                work.on_progress(len(entry.taken), len(work.lines))

        entering = asyncio.ensure_future(
            entry.carry_out(work.address, work.lines, by_escape=work.by_escape, on_taken=on_taken)
        )
        try:
            failure = await asyncio.shield(entering)
        except asyncio.CancelledError as first:
            cancelled = first
            entry.interrupt()
            try:
                await despite_cancellation(_until_over(entering))
            except asyncio.CancelledError as another:
                cancelled = another
            self._note_consequences(entry)
            self._tell_with(cancelled, entry, work)
            raise cancelled from None
        self._note_consequences(entry)
        if failure is not None and not isinstance(failure, CompaxError):
            self._tell_with(failure, entry, work)
            raise failure
        if (error := self._reports.ended(entry, work.lines, failure)) is not None:
            raise error

    def _note_consequences(self, entry: ProgramEntry) -> None:
        """Deal with an axis that may have executed what it should have stored."""
        if entry.may_have_executed:
            self._observer.note_moving()
            self._copy.note_program_ran()
        if entry.moves:
            self._motion.begin_stop()

    def _tell_with(self, error: BaseException, entry: ProgramEntry, work: _Work) -> None:
        """Say in *error*, a cancellation or a caller's own, what it has left; it may be swallowed on its way."""
        report = self._reports.half_written("its writing was ended", entry, work.lines)
        told = escaped(f"{report.device}: {report.what}")
        error.add_note(told)
        if not entry.is_untouched:
            _log.warning("%s", told)

    async def _verified(self, question: str, lines: Sequence[EntryLine]) -> tuple[Listed, ...]:
        """List the program; raise if it is not what was written, or does not show."""
        try:
            shown = await self._shown(question)
        except CompaxError as error:
            raise self._reports.not_listed(lines, error) from error
        except asyncio.CancelledError as error:
            error.add_note(f"{self._observer.name}: the program was acknowledged; whether it is listed so is not known")
            raise
        if (difference := self._reports.listed_otherwise(lines, shown)) is not None:
            raise difference
        return shown

    def _warn_of_rest(self, lines: Sequence[EntryLine], shown: Sequence[Listed]) -> None:
        if (follower := _follower(shown, lines)) is not None:
            _log.warning(
                "%s: behind the program, %r at %d is left of another one, and the axis may go on with it",
                self._observer.name,
                follower.text,
                follower.address,
            )

    @property
    def _profile(self) -> Profile:
        return self._observer.line.settings.profile


async def _until_over(task: asyncio.Future[Exception | None]) -> None:
    await asyncio.wait([task])


def _first_to_write(lines: Sequence[EntryLine], before: Sequence[Listed] | None) -> int | None:
    """Return which instruction is the first that is not there already, at a known address; None if all are."""
    same = 0
    while same < len(lines) and lines[same].text == lines[same].old:
        same += 1
    if same == len(lines):
        if _follower(before or (), lines) is None:
            return None
        same -= 1  # so that the end is said where it shall be
    while lines[same].address is None:
        same -= 1
    return same


def _follower(listing: Sequence[Listed], lines: Sequence[EntryLine]) -> Listed | None:
    """Return the instruction that is listed where *lines* end."""
    begin, last = lines[0].address or 0, lines[-1]
    behind = [each for each in listing if each.text and each.address is not None and each.address >= begin][
        len(lines) :
    ]
    length = nv_length(last.text)
    if not behind or (last.address is not None and length is not None and behind[0].address != last.address + length):
        return None  # or it is a program of its own, further on
    return behind[0]


def _refuse_gaps(lines: Sequence[EntryLine], before: Sequence[Listed]) -> None:
    """Raise unless each of *lines* begins where the one before it ends: they are entered in a row."""
    lengths = learn_lengths(before)
    for each, after in pairwise(lines):
        length = nv_length(each.text, lengths)
        if length is None or each.address is None or after.address != each.address + length:
            raise InvalidCommandError(
                f"behind {each} the listing has a gap, or that length is not known, so what follows cannot be kept",
                hint="write the whole program anew",
            )

"""The end of a job proved: the buffer is empty, what stands behind the job was answered, no error was told."""

from __future__ import annotations

from typing import Final, Literal

from ..errors import AnswerTimeoutError, CompaxError, UnexpectedAnswerError
from ..link.contract import Lane
from .cut import CutAccount
from .facts.reports import HP_GL_ERRORS, NO_ERROR
from .instructions import AskBufferSize, encode
from .line import CutterLine
from .replies import Position, decode_bytes, decode_error, decode_position
from .reports import CutReports
from .watching import MachineWatch

__all__ = ["Finishing"]

_QUIET_S: Final = 0.2
"""Between two positions that must be equal: a cutter may answer ``OA`` while the move before it goes on."""
_ATTEMPTS: Final = 3


class Finishing:
    """
    Proves that a job which was sent whole is cut.

    Args:
        line: Of the cutter.
        watch: Looks after the machine.
        reports: Write the errors.
        is_mode_1: The job ends in mode 1, where instructions of mode 2 are called with ``^``.
    """

    def __init__(self, line: CutterLine, watch: MachineWatch, reports: CutReports, *, is_mode_1: bool) -> None:
        self._line = line
        self._watch = watch
        self._reports = reports
        self._call = "^" if is_mode_1 else ""
        self._mnemonics = line.profile.mnemonics

    async def prove(self, account: CutAccount) -> Literal["OA", ".L"]:
        """
        Wait until all is cut, and say by what that is known.

        Raises:
            MoveInDoubtError: Nothing proves it.
            DriveFaultError: The cutter has told an error.
            MoveTimeoutError, MoveStoppedError: It stalls, or the operator has ended the job.
        """
        await self._watch.until_empty()
        proof = await self._answered_behind(account)
        await self._watch.look_for_errors()
        if "OE" in self._mnemonics:
            await self._look_for_language_error(account)
        return proof

    async def _answered_behind(self, account: CutAccount) -> Literal["OA", ".L"]:
        if "OA" in self._mnemonics and await self._has_come_to_rest():
            return "OA"
        if self._line.profile.size_waits_for_empty and await self._size_is_told():
            return ".L"
        why = "the cutter has not answered anything that stands behind it in its buffer"
        raise self._reports.unproved(why, account)

    async def _has_come_to_rest(self) -> bool:
        """Ask where the tool is until it is twice at the same place."""
        before: Position | None = None
        failures = 0
        while failures < _ATTEMPTS:
            try:
                now = await self._line.read(f"{self._call}OA;", decode_position, Lane.CONTROL, repeats=False)
            except (AnswerTimeoutError, UnexpectedAnswerError):
                failures += 1
                await self._watch.until_empty()  # it may be paused: then nobody answers
                continue
            except CompaxError:
                await self._watch.status()  # says what has become of the line
                raise
            await self._watch.pause(_QUIET_S)
            if now == before:
                return True
            before = now
        return False

    async def _size_is_told(self) -> bool:
        text = encode(AskBufferSize(), self._line.profile).decode()
        try:
            await self._line.read(text, decode_bytes, Lane.CONTROL)
        except (AnswerTimeoutError, UnexpectedAnswerError):
            return False
        return True

    async def language_error(self) -> int:
        """
        Read the error of the cutting language, which clears it (``OE``).

        Raises:
            AnswerTimeoutError, UnexpectedAnswerError, ConnectionLostError: It was not told, and may be cleared.
        """
        return await self._line.read(f"{self._call}OE;", decode_error, Lane.CONTROL, repeats=False)

    async def _look_for_language_error(self, account: CutAccount) -> None:
        try:
            code = await self.language_error()
        except CompaxError as error:
            await self._watch.status()
            why = f"whether it was understood is not known, for OE was not answered: {error.what}"
            raise self._reports.unproved(why, account) from error
        row = HP_GL_ERRORS.get(code)
        if code != NO_ERROR and (row is None or row.ruins_job):
            raise self._reports.faulty_language(code, account)
        if row is not None and code != NO_ERROR:
            self._watch.warnings.append(f"the cutter has told error {code} of OE: {row.meaning}")

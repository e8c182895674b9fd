"""The errors that a job ends with: what happened, what was sent and taken of it, what to do next."""

from __future__ import annotations

from typing import Final, TypeVar

from ..errors import (
    CompaxError,
    DriveFaultError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from .cut import CutAccount
from .facts.reports import HP_GL_ERRORS, IO_ERRORS
from .line import CutterLine, meaning_of

__all__ = ["CutReports", "with_account"]

_Error = TypeVar("_Error", bound=CompaxError)
_Any = TypeVar("_Any", bound=BaseException)

_LOOK: Final = "look at the sheet and the machine, then reconcile(); nothing of the job is sent again by itself"


def with_account(error: _Any, account: CutAccount) -> _Any:
    """Have *error* tell what is known of the job: as ``error.job``, and in a note."""
    error.job = account  # type: ignore[attr-defined]  # part of what a cutter's errors carry
    error.add_note(f"job: {account}")
    return error


class CutReports:
    """
    Writes the errors of one cutter's jobs.

    Args:
        line: Of the cutter.
    """

    def __init__(self, line: CutterLine) -> None:
        self._line = line

    def active(self, what: str) -> MoveActiveError:
        """Report a job that was not sent because another one is under way."""
        return MoveActiveError(
            f"{what} was not sent: another job is under way",
            device=self._line.name,
            hint="await it, or abort() it first",
        )

    def not_empty(self, what: str) -> MoveActiveError:
        """Report a job that was not sent because the machine has something in its buffer."""
        return MoveActiveError(
            f"{what} was not sent: the cutter still has data in its buffer, which nobody here has sent",
            device=self._line.name,
            hint="wait until it is cut; or stop(), which drops it and lifts the tool",
        )

    def refused(self, what: str, why: str) -> MoveInDoubtError:
        """Report a job that was not sent because nobody knows what became of an earlier one."""
        return MoveInDoubtError(
            f"{what} was not sent: {why}", device=self._line.name, hint="look at the sheet, then reconcile()"
        )

    def aborted(self, why: str, account: CutAccount) -> MoveStoppedError:
        """Report a job that was aborted from here."""
        is_sent = account.offset is not None
        hint = "the vector under way was cut to its end, the tool is up, and the cutter takes another job"
        return self._of(
            MoveStoppedError,
            f"the job was {why}; {account}",
            account,
            hint if is_sent else "the cutter takes another job",
        )

    def cancelled_at_machine(self, account: CutAccount) -> MoveStoppedError:
        """Report a job whose data the operator has deleted."""
        return self._of(
            MoveStoppedError,
            f"the cutter has dropped its data while it was paused, as PAUSE and SETUP at the machine do; {account}",
            account,
            "the rest of the job was not sent; begin anew when the machine is set up",
        )

    def perhaps_cancelled(self, account: CutAccount) -> MoveInDoubtError:
        """Report a machine that was paused, and went on, with nobody knowing whether its data was deleted then."""
        return self._doubt(
            "the cutter was paused, and when it went on its buffer was empty, or nobody could see what it held: its "
            f"data may have been deleted, as PAUSE and SETUP at the machine do; {account}",
            account,
        )

    def stalled(self, seconds: float, account: CutAccount, *, is_held: bool) -> MoveTimeoutError:
        """Report a cutter that takes nothing, and is not paused."""
        if is_held:
            what = f"for {seconds:g} s the line was held, as by a full buffer"
            hint = "is the machine paused, or its SETUP lamp off? Is the cable one that hardwire handshake can use?"
        else:
            what = f"for {seconds:g} s the cutter has taken nothing, and it is not paused"
            hint = "is its SETUP lamp lit, and a sheet loaded? Is POWER/ERROR blinking? stall_timeout_s waits longer"
        return self._of(MoveTimeoutError, f"{what}; {account}", account, hint)

    def faulty(self, code: int, account: CutAccount) -> DriveFaultError:
        """Report an error of the line that ruins the job (``.E``, PNC-900 p. 21)."""
        error = IO_ERRORS.get(code)
        report = self._of(
            DriveFaultError,
            f"the job is ruined: {meaning_of(code)}; {account}",
            account,
            error.remedy if error is not None else _LOOK,
        )
        report.code = code
        return report

    def faulty_language(self, code: int, account: CutAccount) -> DriveFaultError:
        """Report an error of the cutting language (``OE``)."""
        error = HP_GL_ERRORS.get(code)
        meaning = error.meaning if error is not None else "which no manual at hand has"
        report = self._of(
            DriveFaultError,
            f"the cutter has not understood the job: error {code} of OE, {meaning}; {account}",
            account,
            error.remedy if error is not None else _LOOK,
        )
        report.code = code
        return report

    def lost(self, cause: CompaxError, account: CutAccount) -> MoveInDoubtError:
        """Report a job whose line was lost, or whose cutter says nothing any more."""
        error = self._doubt(f"what was cut is not known: {cause.what}; {account}", account)
        error.__cause__ = cause
        return error

    def forgotten(self, account: CutAccount) -> MoveInDoubtError:
        """Report a cutter that was switched off and on, or reset, in the middle of a job."""
        return self._doubt(
            "the cutter has forgotten its settings in the middle of the job: it was switched off and on, or reset by "
            f"somebody else, and what its buffer held is not cut; {account}",
            account,
        )

    def unproved(self, why: str, account: CutAccount) -> MoveInDoubtError:
        """Report a job that was sent whole, and that nothing proves to be cut."""
        return self._doubt(f"the job was sent whole, but {why}; {account}", account)

    def not_stopped(self, why: str, cause: CompaxError, account: CutAccount) -> MoveInDoubtError:
        """Report a job whose abort nothing has confirmed."""
        error = self._doubt(f"the job was {why}, but the cutter has not shown that it stopped: {cause.what}", account)
        error.hint = "look at the machine, and use its switch if it moves; then reconcile()"
        error.__cause__ = cause
        return error

    def _doubt(self, what: str, account: CutAccount) -> MoveInDoubtError:
        return self._of(MoveInDoubtError, what, account, _LOOK)

    def _of(self, kind: type[_Error], what: str, account: CutAccount, hint: str) -> _Error:
        error = kind(what, device=self._line.name, hint=hint, exchanges=self._line.link.recent())
        return with_account(error, account)

"""The errors that a transfer ends with: what happened, how far it came, and what to do at the control."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeVar

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    UnexpectedAnswerError,
)
from ..link.link import Link
from .profiles import Profile
from .transfer import Damage, Kind, TransferAccount
from .transfers.account import Ending

__all__ = ["TransferReports", "operator_text", "with_account"]

_Error = TypeVar("_Error", bound=CompaxError)

_SETTINGS: Final = "Settings 11 (baud rate), 12 (parity), 13 (stop bits), 14 (synchronization) and 37 (data bits)"
_CHOOSE: Final[dict[Kind, str]] = {
    "program": "choose the program",
    "programs": "choose ALL programs",
    "parameters": "show the parameters",
    "settings": "show the settings",
    "offsets": "show the offsets",
    "macros": "show the macro variables",
}
_SCREEN: Final = "what the control made of it, its screen says: RS232 DONE or RS232 ABORT, and the alarms"


_STORIES: Final[Mapping[Ending, tuple[type[CompaxError], str, str]]] = {
    Ending.NOT_STARTED: (
        AnswerTimeoutError,
        "the control {did_not} the {kind} in time",
        f"{{operator}}; if that was done, compare {_SETTINGS} with the profile {{profile!r}}, and look whether pins 2 "
        "and 3 are crossed in the cable, and 4 and 5",
    ),
    Ending.WENT_SILENT: (
        AnswerTimeoutError,
        "the control has fallen silent in the middle of the {kind}",
        f"was RESET pressed? {_SCREEN}; then begin anew: a transfer is never resumed",
    ),
    Ending.END_UNANSWERED: (
        AnswerTimeoutError,
        "the control has taken all of the {kind}, and not acknowledged its end",
        f"whether it is stored is not known: {_SCREEN}",
    ),
    Ending.UNLIKE: (
        UnexpectedAnswerError,
        "the control sends by another synchronization than the profile {profile!r} has",
        "set both to the same: Setting 14 (synchronization) of the control, and the profile; then begin anew",
    ),
    Ending.HELD_TOO_LONG: (
        AnswerTimeoutError,
        "the control has told to stop (Xoff) and never to go on",
        f"is its memory full, or does it show an alarm? {_SCREEN}",
    ),
    Ending.STUCK: (
        AnswerTimeoutError,
        "what was written does not leave the line",
        "with RTS/CTS the control, or its cable (pins 4 and 5), holds the line; over a network, what is in between",
    ),
    Ending.CANCELLED: (CommandRejectedError, "the control has cancelled the transfer (CAN)", _SCREEN),
    Ending.GARBLED: (
        UnexpectedAnswerError,
        "the same block was damaged, or lost, again and again",
        f"is the line disturbed? Compare {_SETTINGS} with the profile; shorten the cable, or lower the baud rate",
    ),
    Ending.TOO_LARGE: (
        UnexpectedAnswerError,
        "the {kind} has more bytes than are to be received",
        "ControlSettings.max_bytes says how many that is; what still comes is dropped",
    ),
    Ending.GIVEN_UP: (ConnectionLostError, "the transfer was given up", f"begin anew; {_SCREEN}"),
    Ending.LINE_LOST: (ConnectionLostError, "the line was lost", f"begin anew; {_SCREEN}"),
}


def operator_text(kind: Kind, *, sends: bool) -> str:
    """Say what has to be done at the control, for a transfer of that kind to begin."""
    if kind == "drip feed":
        return "press MDI/DNC twice at the control, so that it waits for the program, and then CYCLE START"
    key = "RECV" if sends else "SEND"
    page = "show the list of programs" if sends and kind in {"program", "programs"} else _CHOOSE[kind]
    return f"at the control, {page} and press {key}"


def with_account(error: _Error, account: TransferAccount) -> _Error:
    """Have *error* tell what is known of the transfer: as ``error.transfer``, and in a note; the newest is told."""
    if not hasattr(error, "transfer"):
        error.add_note(f"transfer: {account}")
    error.transfer = account  # type: ignore[attr-defined]  # part of what a control's errors carry
    return error


def _second_look(account: TransferAccount) -> str:
    """Say, of a file that is there to be compared, how it stands with the file itself."""
    if account.phase != "verifying":
        return ""
    if account.way == "send":
        return ", when it was to send back what it had stored; it was sent to its end before"
    return ", when it was to come a second time; it came to its end the first time"


class TransferReports:
    """
    Writes the errors of one control's transfers.

    Args:
        name: Of the control.
        profile: How it is set up.
        link: Its line, whose last bytes every error tells.
    """

    def __init__(self, name: str, profile: Profile, link: Link) -> None:
        self._name = name
        self._profile = profile
        self._link = link

    def active(self, what: str, under_way: str) -> InvalidCommandError:
        """Report a transfer that was not begun because there is another one."""
        return InvalidCommandError(
            f"{what} was not begun: {under_way} is under way on this line",
            device=self._name,
            hint="await that transfer, or cancel() it first",
        )

    def no_files(self, what: str) -> InvalidCommandError:
        """Report a transfer over a line that no files go over."""
        return InvalidCommandError(
            f"{what} was not begun: the profile {self._profile.name!r} has no synchronization (Setting 14)",
            device=self._name,
            hint="take a profile with the one that the control is set to: compax_aio.haas.PROFILES; over Ethernet a "
            "control answers questions only",
        )

    def of_ending(self, ending: Ending, account: TransferAccount, detail: str = "") -> CompaxError:
        """Report a transfer that did not end well, by how it ended."""
        kind_of_error, what, hint = _STORIES[ending]
        sends = account.way == "send" and account.phase != "verifying"
        words = {
            "kind": account.kind,
            "did_not": "was not ready to read" if sends else "did not send",
            "operator": operator_text(account.kind, sends=sends),
            "profile": self._profile.name,
        }
        what = what.format_map(words) + (f" ({detail})" if detail else "") + _second_look(account)
        return self._of(kind_of_error, f"{what}; {account}", account, hint.format_map(words))

    def lost(self, account: TransferAccount, cause: CompaxError) -> ConnectionLostError:
        """Report a transfer whose line was lost, or closed."""
        waits = account.way == "send" and account.phase != "verifying"
        reset = "press RESET at the control, which waits for the rest, and " if waits else ""
        hint = f"a transfer is never resumed: {reset}begin anew when the line is back; {_SCREEN}"
        error = self._of(ConnectionLostError, f"{cause.what}{_second_look(account)}; {account}", account, hint)
        error.__cause__ = cause
        return error

    def damaged(self, damage: Damage, account: TransferAccount) -> UnexpectedAnswerError:
        """Report a file that came damaged."""
        return self._of(
            UnexpectedAnswerError,
            f"the {account.kind} came damaged: {damage}",
            account,
            f"receive it again; is the line disturbed, or do {_SETTINGS} differ from the profile? accept_damaged=True "
            "takes it as it is",
        )

    def unlike(self, why: CompaxError | str, account: TransferAccount) -> UnexpectedAnswerError:
        """Report what came and is not of the kind that was asked for."""
        said = why.what if isinstance(why, CompaxError) else why
        hint = why.hint if isinstance(why, CompaxError) and why.hint else None
        error = self._of(
            UnexpectedAnswerError,
            f"what came is no file of {account.kind}: {said}",
            account,
            hint
            or f"was something else chosen at the control? To receive it, {operator_text(account.kind, sends=False)}",
        )
        if isinstance(why, CompaxError):
            error.__cause__ = why
        return error

    def unequal(self, what: str, account: TransferAccount, hint: str) -> UnexpectedAnswerError:
        """Report a file that is another one at the second look."""
        return self._of(UnexpectedAnswerError, what, account, hint)

    def no_archive(self, cause: OSError, account: TransferAccount) -> InvalidCommandError:
        """Report a transfer that was not begun because what comes could not be kept."""
        error = self._of(
            InvalidCommandError,
            f"the archive cannot be written: {cause}",
            account,
            "nothing is listened for; name a file or a folder that you may write to",
        )
        error.__cause__ = cause
        return error

    def unreadable(self, cause: OSError, account: TransferAccount) -> InvalidCommandError:
        """Report a transfer that was not begun because the file that is to be sent cannot be read."""
        error = self._of(
            InvalidCommandError,
            f"what is to be sent cannot be read: {cause}",
            account,
            "nothing was sent; is it there?",
        )
        error.__cause__ = cause
        return error

    def unwritten(self, cause: OSError, data: bytes, account: TransferAccount) -> InvalidCommandError:
        """Report a file that came, and could not be kept."""
        error = self._of(
            InvalidCommandError,
            f"the {account.kind} came, but could not be written to the archive: {cause}",
            account,
            "the bytes are error.data; is the disk full?",
        )
        error.data = data  # type: ignore[attr-defined]
        error.__cause__ = cause
        return error

    def _of(self, kind: type[_Error], what: str, account: TransferAccount, hint: str) -> _Error:
        return with_account(kind(what, device=self._name, hint=hint, exchanges=self._link.recent()), account)

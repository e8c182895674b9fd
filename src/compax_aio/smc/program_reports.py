"""The errors that writing a program ends with: what the axis has acknowledged, what not, and what nobody knows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from ..errors import CompaxError, MoveStoppedError, RestoreIncompleteError
from .codecs import Listed
from .observer import Observer
from .program_entry import EntryLine, ProgramEntry

__all__ = ["ProgramReports"]

_KIND: Final = "program"
_MOST_NAMED: Final = 8
_HINT: Final = "do not run it; list() shows what is there, and write() goes on from where that differs"


class ProgramReports:
    """
    Writes the errors of one axis's program memory.

    Args:
        observer: Of the axis.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer

    def ended(self, entry: ProgramEntry, lines: Sequence[EntryLine], failure: CompaxError | None) -> CompaxError | None:
        """Return the error that an entry of *lines* ended with; None if all is well."""
        if entry.moves:
            what = "the axis moves, as if it had executed what it should store, and was stopped"
            return self.half_written(what, entry, lines, failure)
        if failure is not None:
            if entry.is_untouched:
                return failure
            return self.half_written(f"its writing failed: {failure.what}", entry, lines, failure)
        if len(entry.taken) == len(lines) and entry.doubt is None:
            return None
        return self._broken_off(entry, lines)

    def _broken_off(self, entry: ProgramEntry, lines: Sequence[EntryLine]) -> CompaxError:
        if entry.is_untouched:
            return MoveStoppedError("a stop came before the program was written", device=self._observer.name)
        what = "its writing was stopped" if entry.is_interrupted else "its end was not confirmed"
        if entry.was_aborted:
            what = "its writing was aborted (ESC or ^C)"
        return self.half_written(what, entry, lines)

    def half_written(
        self, what: str, entry: ProgramEntry, lines: Sequence[EntryLine], cause: CompaxError | None = None
    ) -> RestoreIncompleteError:
        """Say *what* has happened, and how far it has got."""
        taken = tuple(entry.taken)
        uncertain = () if entry.uncertain is None else (entry.uncertain,)
        rest = lines[len(taken) + len(uncertain) :]
        parts = [f"the program is not complete, {what}", _named("acknowledged", taken), _named("not stored", rest)]
        if uncertain:
            parts.append(_named("stored, in part, or not, with what follows perhaps damaged", uncertain))
        if entry.doubt is not None:
            parts.append(entry.doubt)
        return self._incomplete("; ".join(parts), taken, rest, uncertain, cause)

    def not_listed(self, lines: Sequence[EntryLine], cause: CompaxError) -> RestoreIncompleteError:
        """Say that all was acknowledged, and that nobody could look at it afterwards."""
        what = f"the program was acknowledged, but not listed afterwards: {cause.what}"
        return self._incomplete(what, lines, (), (), cause)

    def listed_otherwise(self, lines: Sequence[EntryLine], shown: Sequence[Listed]) -> RestoreIncompleteError | None:
        """Say where the axis lists something else than was written; None if it lists just that."""
        begin = lines[0].address or 0
        found = [each for each in shown if each.text and each.address is not None and each.address >= begin]
        pairs = [(line, found[at] if at < len(found) else None) for at, line in enumerate(lines)]
        if all(each is not None and line.is_shown_by(each) for line, each in pairs):
            return None
        same = tuple(line for line, each in pairs if each is not None and line.is_shown_by(each))
        others = [(line, each) for line, each in pairs if line not in same]
        differences = ", ".join(
            f"{f'{each.text!r} at {each.address}' if each is not None else 'nothing'} where {line} was written"
            for line, each in others[:_MOST_NAMED]
        )
        more = f", and {len(others) - _MOST_NAMED} more" if len(others) > _MOST_NAMED else ""
        error = self._incomplete(
            f"the axis lists another program than it acknowledged: {differences}{more}",
            same,
            (),
            tuple(line for line, _ in others),
        )
        error.received = " / ".join(f"{each.address} {each.text}".strip() for each in shown)
        return error

    def _incomplete(
        self,
        what: str,
        applied: Iterable[EntryLine],
        rest: Iterable[EntryLine],
        uncertain: Iterable[EntryLine],
        cause: CompaxError | None = None,
    ) -> RestoreIncompleteError:
        error = RestoreIncompleteError(
            what,
            applied={line.address: (line.old, line.text) for line in applied if line.address is not None},
            not_applied=tuple(line.address for line in rest if line.address is not None),
            uncertain={line.address: (line.old, line.text) for line in uncertain if line.address is not None},
            kind=_KIND,
            device=self._observer.name,
            sent=None if cause is None else cause.sent,
            received=None if cause is None else cause.received,
            hint=_HINT,
            exchanges=self._observer.line.link.recent(),
        )
        error.__cause__ = cause
        return error


def _named(what: str, lines: Sequence[EntryLine]) -> str:
    named = ", ".join(map(str, lines[:_MOST_NAMED])) or "nothing"
    more = f" and {len(lines) - _MOST_NAMED} more" if len(lines) > _MOST_NAMED else ""
    return f"{what}: {named}{more}"

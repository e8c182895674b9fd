"""A file looked at twice: what that proves, and what only the control's screen can say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from .comparing import Difference, How, diff
from .language.data_file import DataFile
from .language.program_file import ProgramFile
from .transfer import Kind

__all__ = ["ONLY_ON_SCREEN", "Verified", "only_on_screen", "verified_received", "verified_sent"]

ONLY_ON_SCREEN: Final = (
    "RS232 DONE or RS232 ABORT in the bottom left corner, and the alarms: the control tells nobody else whether it has "
    "stored what it was sent"
)
_DATA_ONLY_ON_SCREEN: Final = "; data are loaded even where there is an alarm"
_MOST_TOLD: Final = 5
_PIECE_BYTES: Final = 4096
_AFTER_FEEDING: Final = "whether the machine has run it to its end, and the alarms; nothing of it is stored"
_AFTER_READING_BACK: Final = "alarms, and whether the machine shall work with it"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """What a second look at a file has shown."""

    equal: Literal["byte for byte", "in content", "no"]
    """``in content``: spaces, ends of blocks, or the checksum N0 of the control are others, and nothing else."""
    differences: tuple[Difference, ...] = ()
    """What is not equal; of programs, where it begins."""
    proves: str
    """In words."""

    def __bool__(self) -> bool:
        return self.equal != "no"


def only_on_screen(kind: Kind, *, is_read_back: bool) -> str:
    """Say what nobody but the control's screen tells of a file that was sent."""
    if is_read_back:
        return _AFTER_READING_BACK
    if kind == "drip feed":
        return _AFTER_FEEDING
    return ONLY_ON_SCREEN + (_DATA_ONLY_ON_SCREEN if kind in {"parameters", "settings", "offsets", "macros"} else "")


def verified_received(first: bytes, second: bytes) -> Verified:
    """Compare what came with what came the second time, byte for byte; for a thread, for it may be large."""
    if first == second:
        return Verified(
            equal="byte for byte",
            proves="the same bytes came twice: chance damage would have had to strike the same places alike; that the "
            "control has sent what it has stored, it proves no more than its screen",
        )
    return Verified(equal="no", proves=f"what came the second time differs {_place(first, second)}")


def verified_sent(sent: ProgramFile | DataFile, back: ProgramFile | DataFile) -> Verified:
    """
    Compare what was sent with what the control sends back; for a thread, for it may be large.

    Programs that were never sent do not count: with ALL, a control sends back whatever it has.
    """
    if sent.payload == back.payload:
        return Verified(equal="byte for byte", proves="the control has sent back the same bytes: it has stored them")
    differences = diff(sent, back)
    if isinstance(sent, ProgramFile):
        differences = tuple(each for each in differences if each.how is not How.ADDED or each.number in sent.numbers)
    if differences:
        said = f"the control has something else stored: {'; '.join(map(str, differences[:_MOST_TOLD]))}"
        more = f" and {len(differences) - _MOST_TOLD} more" if len(differences) > _MOST_TOLD else ""
        return Verified(equal="no", differences=differences, proves=said + more)
    return Verified(
        equal="in content", proves="the control has sent back the same content, in another form: it has stored it"
    )


def _place(first: bytes, second: bytes) -> str:
    shorter = min(len(first), len(second))
    for begin in range(0, shorter, _PIECE_BYTES):
        end = min(begin + _PIECE_BYTES, shorter)
        if first[begin:end] != second[begin:end]:
            at = next(each for each in range(begin, end) if first[each] != second[each])
            return f"from byte {at} on: {first[at]:02X}, and then {second[at]:02X} (hexadecimal)"
    return f"in length: {len(first)} bytes, and then {len(second)}"

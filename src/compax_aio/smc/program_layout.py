"""Where the instructions of a stored program lie, and how one of them may be exchanged without harm to the others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import Final

from ..errors import InvalidCommandError
from .codecs import Listed
from .facts import INSTRUCTION_BYTES, MAX_COMMAND_LENGTH

__all__ = ["EditPlan", "check_jumps", "learn_lengths", "nv_length", "plan_exchange"]

_JUMP: Final = "J"


@dataclass(frozen=True, slots=True, kw_only=True)
class EditPlan:
    """How one instruction is exchanged, so that the others are what they were."""

    address: int
    """Where program entry begins (``P``)."""
    instructions: tuple[str, ...]
    """One alone if its length stays, else all from there to the end of the program."""
    is_in_place: bool
    """One instruction, after which entry is left by ESC (AMS p. 25); otherwise it is ended as DCB p. 24 has it."""
    expected: tuple[Listed, ...]
    """What a listing must show afterwards, without the place behind it; anything else has gone wrong."""
    moved: Mapping[int, int] = field(hash=False)
    """Addresses before and after, of what begins elsewhere; who starts a program there must know."""
    left_over_bytes: int = 0
    """
    Of the old program, behind the end of the new one, which is shorter.

    Whether the end of entry marks the end of a program is not documented.
    """


def nv_length(text: str, lengths: Mapping[str, int] = INSTRUCTION_BYTES) -> int | None:
    """Return how many bytes an instruction takes (DCB p. 24), by its letter alone; None if that is not known."""
    return lengths.get(text[:1])


def learn_lengths(listing: Iterable[Listed], known: Mapping[str, int] = INSTRUCTION_BYTES) -> Mapping[str, int]:
    """
    Return the lengths in bytes, by letter, that are known from a listing and before it.

    A letter of which the listing says two things, or never what was known before, is not known any more. Behind the
    last instruction of one program another may begin at any address (DCB p. 24): more than 12 bytes teach nothing.
    """
    seen: dict[str, set[int]] = {}
    for each, after in pairwise(listing):
        if each.text and each.address is not None and after.address is not None:
            length = after.address - each.address
            if length <= MAX_COMMAND_LENGTH:
                seen.setdefault(each.text[0], set()).add(length)
    lengths = dict(known)
    for letter, found in seen.items():
        if letter in known and known[letter] in found:
            continue
        if letter in known or len(found) > 1:
            lengths.pop(letter, None)
        else:
            lengths[letter] = found.pop()
    return MappingProxyType(lengths)


def check_jumps(listing: Sequence[Listed]) -> Iterator[tuple[int, str]]:
    """Yield what is wrong with jumps: the place of each in *listing*, and what it is."""
    addresses = {each.address for each in listing if each.text}
    for index, each in enumerate(listing):
        target = _jump_target(each.text)
        if target is None or target in addresses:
            continue
        if None in addresses and target > max((known for known in addresses if known is not None), default=-1):
            yield index, f"whether an instruction begins at {target} is not known: lengths before it are not"
        else:
            yield index, f"no instruction begins at {target}"


def plan_exchange(
    listing: Iterable[Listed], address: int, new_text: str, lengths: Mapping[str, int] | None = None
) -> EditPlan:
    """
    Plan how the instruction at *address* becomes *new_text*, by the lengths of both.

    Entered over one of another length it would overwrite what follows, or leave a part of the old one (AMS p. 25). So
    the rest of the program is entered anew then, and every jump into it follows its instruction; in *new_text*, too,
    an address is one of the listing as it is now.

    Args:
        listing: Of the whole program, as the axis shows it.
        address: Where the old instruction begins.
        new_text: Checked and tidied.
        lengths: In bytes, by letter; without them, as ``learn_lengths()`` has them from the listing.

    Raises:
        InvalidCommandError: No instruction begins there, a length is not known, the listing has a gap, or a jump
            leads to no instruction.
    """
    program = list(listing)
    known = learn_lengths(program) if lengths is None else lengths
    addresses = [_known_address(each) for each in program]
    end = addresses[-1] if program and not program[-1].text else None
    program = [each for each in program if each.text]
    index = _index_of(address, program)
    old = _length(program[index].text, known)
    new = _length(new_text, known)
    _expect_targets([new_text], program)
    if old == new:
        _expect_no_gap(program, range(index, index + 1), end, known)
        return _in_place(program, index, new_text)
    return _rewritten(program, index, new_text, new - old, end=end, known=known)


def _in_place(program: list[Listed], index: int, new_text: str) -> EditPlan:
    address = _known_address(program[index])
    return EditPlan(
        address=address,
        instructions=(new_text,),
        is_in_place=True,
        expected=(*program[:index], Listed(address, new_text), *program[index + 1 :]),
        moved=MappingProxyType({}),
    )


def _rewritten(
    program: list[Listed], index: int, new_text: str, shift: int, *, end: int | None, known: Mapping[str, int]
) -> EditPlan:
    address = _known_address(program[index])
    moved = {(old := _known_address(each)): old + shift for each in program[index + 1 :]}
    others = (each.text for each in program if each is not program[index])
    _expect_targets((text for text in others if (_jump_target(text) or 0) > address), program)
    texts = [new_text if at == index else each.text for at, each in enumerate(program)]
    texts = [_followed(text, moved) for text in texts]
    expected = tuple(
        Listed(moved.get(_known_address(each), each.address), text) for each, text in zip(program, texts, strict=True)
    )
    first = next(at for at, text in enumerate(texts) if text != program[at].text)
    _expect_no_gap(program, range(first, len(program)), end, known)
    return EditPlan(
        address=_known_address(program[first]),
        instructions=tuple(texts[first:]),
        is_in_place=False,
        expected=expected,
        moved=MappingProxyType(moved),
        left_over_bytes=max(-shift, 0),
    )


def _jump_target(text: str) -> int | None:
    if not text.startswith(_JUMP):
        return None
    target = text[1:].replace(",", " ").split(" ")[0]
    return int(target) if target.isascii() and target.isdecimal() else None


def _followed(text: str, moved: Mapping[int, int]) -> str:
    target = _jump_target(text)
    if target not in moved or target is None:
        return text
    return f"{_JUMP}{moved[target]}{text[len(_JUMP) + len(str(target)) :]}"


def _index_of(address: int, program: Sequence[Listed]) -> int:
    for index, each in enumerate(program):
        if each.address == address:
            return index
    places = ", ".join(str(each.address) for each in program)
    raise InvalidCommandError(
        f"no instruction begins at {address}", hint=f"they begin at {places}" if places else "the program is empty"
    )


def _known_address(listed: Listed) -> int:
    if listed.address is None:
        raise InvalidCommandError(f"where {listed.text!r} begins is not known", hint="list the program first")
    return listed.address


def _length(text: str, known: Mapping[str, int]) -> int:
    length = nv_length(text, known)
    if length is None:
        raise InvalidCommandError(
            f"how many bytes {text[:1]!r} takes is not known, or not beyond doubt",
            hint="enter the whole program anew, or a program with such an instruction where nothing can be harmed: "
            "its listing shows the length",
        )
    return length


def _expect_targets(texts: Iterable[str], program: Sequence[Listed]) -> None:
    addresses = {each.address for each in program}
    for text in texts:
        target = _jump_target(text)
        if target is not None and target not in addresses:
            raise InvalidCommandError(f"no instruction begins at {target}, where {text!r} leads")


def _expect_no_gap(program: Sequence[Listed], places: range, end: int | None, known: Mapping[str, int]) -> None:
    for at in places:
        after = program[at + 1].address if at + 1 < len(program) else end
        address, length = _known_address(program[at]), _length(program[at].text, known)
        if after is not None and after - address != length:
            raise InvalidCommandError(
                f"{program[at].text!r} at {address} takes {length} byte{'s' if length > 1 else ''}, and the next "
                f"place is {after}: the listing has a gap, or is damaged",
                hint="enter the whole program anew",
            )

"""``compax haas receive``: what a control sends, kept in a file as it came, and what of it is proved."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from cyclopts import Parameter

from compax_aio import InvalidCommandError
from compax_aio.escaping import escaped
from compax_aio.haas.control import Control
from compax_aio.haas.language.program_file import ProgramFile
from compax_aio.haas.transfer import Received, Transfer

from ...text_file import name_of
from ..exit_codes import OK
from ..files import Force, expect_free
from ..interruption import moves_nothing
from ..printing import Printing
from .conducting import Conductor, OnOperator
from .line import ControlLine, ControlUrl, SetUp
from .operator import Operator
from .view import written_time

__all__ = ["receive"]

What = Literal["program", "programs", "parameters", "settings", "offsets", "macros"]

_MOST_NAMES: Final = 10
_LEFT_OUT: Final = frozenset({"data", "file", "archive"})
"""Of what is told to programs: it is in the file."""


@dataclass(frozen=True, kw_only=True)
class Contents:
    """What is in a file that came."""

    programs: tuple[str, ...] = ()
    """Their names, with their comments."""
    values: int | None = None
    """How many numbers there are; None of programs."""
    checksum: str | None = None
    """The value of N0."""


@moves_nothing
async def receive(
    url: ControlUrl,
    what: Annotated[What, Parameter(help="What is chosen at the control; programs: ALL.")],
    *,
    out: Annotated[
        str,
        Parameter(
            name=("--out", "-o"),
            help="File; or a folder, in which it gets a name by what it is and the time. The current folder if not "
            "given.",
        ),
    ] = ".",
    verify: Annotated[bool, Parameter(negative=(), help="Receive it twice, and compare byte for byte.")] = False,
    accept_damaged: Annotated[
        bool, Parameter(negative=(), help="Keep it although it is known to be damaged, or not known to be whole.")
    ] = False,
    force: Force = False,
    set_up: SetUp = SetUp(),  # noqa: B008 - it is frozen
    line: ControlLine = ControlLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Receive a program, all programs, or numbered data, and keep them byte for byte.

    The line is listened to from now on; then somebody has to choose it at the control and press SEND, which is said.
    While it comes it is in FILE.incomplete, and is renamed when it is whole. Nothing is ever received half and called
    whole. Ctrl-C gives up, and what came stays in FILE.incomplete.

    ```sh
    compax haas receive serial:///dev/ttyUSB0 program
    compax haas receive serial:///dev/ttyUSB0 parameters --out parameters.txt --verify
    compax haas receive tcp://192.168.1.50:4001 programs --profile classic-dc-codes --out backup/
    ```
    """
    profile = set_up.known()
    place = _place(out, force=force)
    conductor = Conductor(printing, Operator(profile, printing, sends=False))

    def begin(control: Control, on_operator: OnOperator) -> Transfer[Received]:
        how: dict[str, Any] = {"archive": place, "verify": verify, "accept_damaged": accept_damaged}
        transfer: Transfer[Received] = getattr(control, f"receive_{what}")(on_operator=on_operator, **how)
        return transfer

    with conductor.telling():
        async with line.open(url, profile) as control:
            received = await conductor.carry_out(what, lambda on_operator: begin(control, on_operator))
    _tell_received(received, place, conductor.took_s, printing)
    return OK


def _place(out: str, *, force: bool) -> Path:
    """
    Return the file, or the folder that there is; to be asked before anybody goes to the control.

    Raises:
        InvalidCommandError: It cannot be written, or there is no such folder.
    """
    place = Path(out)
    if out and place.is_dir():
        return place
    if not out or out.endswith(("/", os.sep)):  # an empty word is that of a script whose variable is not set
        raise InvalidCommandError(f"there is no folder {out!r}", hint="make it first")
    expect_free(place, force=force)
    return place


def _tell_received(received: Received, out: Path, took_s: float, printing: Printing) -> None:
    """Say what came, what proves it, and what nothing does."""
    contents = _contents_of(received)
    told = {each.name: getattr(received, each.name) for each in fields(received) if each.name not in _LEFT_OUT}
    told["verified"] = None if received.verified is None else {"equal": received.verified.equal}
    assert received.archive is not None  # one was asked for
    file = _named_as_given(out, received.archive)
    lines = [
        f"{name_of(file)}: {received.kind}, {len(received.data):,} bytes in {written_time(took_s)}: "
        f"{_in_words(contents)}",
        f"  proved by {received.proof}; {_of_damage(received)}",
    ]
    printing.show(
        {"received": told, "file": str(file), "bytes": len(received.data), "contents": contents},
        "\n".join(lines),
    )
    for warning in received.warnings:
        printing.note(f"{received.kind}: {warning}")


def _named_as_given(out: Path, archive: Path) -> Path:
    """Name the file as the command did; elsewhere than it was to be, by its own name."""
    if out.is_dir():
        return out / archive.name
    return out if archive == Path(os.path.realpath(out)) else archive


def _contents_of(received: Received) -> Contents:
    """Return what is in it."""
    file = received.file
    if isinstance(file, ProgramFile):
        return Contents(programs=tuple(escaped(str(each)) for each in file.programs))
    return Contents(values=len(file.values), checksum=file.checksum)


def _in_words(contents: Contents) -> str:
    if contents.values is not None:
        n0 = "no N0" if contents.checksum is None else f"N0 {contents.checksum}"
        return f"{contents.values} values, {n0}"
    names = ", ".join(contents.programs[:_MOST_NAMES])
    more = len(contents.programs) - _MOST_NAMES
    return names + (f" and {more} more" if more > 0 else "")


def _of_damage(received: Received) -> str:
    if received.verified is not None:
        return received.verified.proves
    if received.damage is None:
        return "nothing on this line tells damage: --verify receives it twice"
    return str(received.damage)

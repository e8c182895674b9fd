"""What a simulated control sends: programs and numbered data as bytes, with ends of block, ``%``, N0 and N9999."""

from __future__ import annotations

from collections.abc import Sequence

from compax_aio.haas.facts.data_files import CHECKSUM_NUMBER, DATA_FILES, LAST_NUMBER, DataKind, Presence
from compax_aio.haas.facts.port_settings import ADD_SPACES

from .blocks import sent_block
from .memory import name_of
from .presses import program_number
from .sinks import Checksum
from .surroundings import Surroundings

__all__ = ["programs_sent", "table_sent"]


def programs_sent(around: Surroundings, names: Sequence[str]) -> bytes:
    """Return the file of programs, one or several."""
    knobs = around.knobs
    groups = [names] if knobs.all_in == "one_pair" else [[name] for name in names]
    lines: list[str] = [""] if knobs.lead_in else []
    for group in groups:
        lines.append("%")
        for name in group:
            lines += _program_lines(around, name)
        if knobs.blank_before_end:
            lines.append("")
        lines.append("%")
    return _joined(around, lines)


def _program_lines(around: Surroundings, name: str) -> list[str]:
    spaced = around.memory.is_on(ADD_SPACES, around.knobs.spaces)
    text = around.memory.programs[name]
    first, *others = text.split("\n")
    number = program_number(name)
    assert number is not None
    comment = first.removeprefix(name)
    return [
        name_of(number, around.knobs.o_digits) + comment,
        *(sent_block(each, spaced=spaced) if each else "" for each in others),
    ]


def table_sent(around: Surroundings, kind: DataKind, checksum: Checksum) -> bytes:
    """Return the file of numbered data."""
    rules, digits = DATA_FILES[kind], around.knobs.v_digits
    stored = around.memory.table(kind)
    values = {number: value.zfill(digits) if value.isdigit() else value for number, value in stored.items()}
    lines = ["%"]
    if rules.checksum is not Presence.ABSENT:
        lines.append(f"N{CHECKSUM_NUMBER} V{checksum(kind, values)}")
    lines += [f"N{number} V{value}" for number, value in values.items()]
    if rules.last_line is not Presence.ABSENT:
        lines.append(f"N{LAST_NUMBER} V0")
    return _joined(around, [*lines, "%"])


def _joined(around: Surroundings, lines: Sequence[str]) -> bytes:
    eob = around.knobs.eob_pattern.data
    return b"".join(line.encode("latin-1", "replace") + eob for line in lines)

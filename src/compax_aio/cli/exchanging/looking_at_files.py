"""``compax haas check`` and ``diff``: what is wrong with files, and in what two differ, without a machine."""

from __future__ import annotations

from typing import Annotated, Any, Final

from cyclopts import Parameter
from rich.text import Text

from compax_aio import InvalidCommandError
from compax_aio.escaping import escaped
from compax_aio.haas.comparing import Difference, diff
from compax_aio.haas.facts.data_files import DataKind
from compax_aio.haas.language.data_file import DataFile, parse_data_file
from compax_aio.haas.language.program_file import ProgramFile, parse_program_file
from compax_aio.severity import Severity

from ..exit_codes import OK
from ..interruption import moves_nothing
from ..printing import Printing
from ..problems import has_errors, told
from .files import ControlFile, KindOption, NamedFile, read_file
from .line import SetUp
from .problems import Meant, as_data, problems_of

__all__ = ["check", "compare"]

_HAS_ERRORS: Final = 1
_DIFFER: Final = 1
_UNKNOWN: Final = "numbered data"


@moves_nothing
def check(
    *files: ControlFile,
    kind: KindOption = None,
    meant: Meant = Meant(),  # noqa: B008 - it is frozen
    set_up: SetUp = SetUp(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Say what is wrong with files, by line and column, and which alarm it would raise; without a machine.

    Programs: % lines, names, protected numbers, small letters, characters that mean something on the line, semicolons,
    line numbers that have crashed a control in DNC. Numbered data: lines, N0 and N9999. What the codes of a program
    mean to the machine is not looked at. Exits with 1 if there is an error, which `send` would refuse.

    ```sh
    compax haas check O01234.nc
    compax haas check surface.nc --dnc
    compax haas check backup/*.txt --kind settings --json
    ```
    """
    if not files:
        raise InvalidCommandError("no file was named")
    profile = set_up.known()
    code = OK
    for path in files:
        file = read_file(path, "program" if meant.dnc and kind is None else kind)
        problems = problems_of(file, profile, meant)
        code = max(code, _HAS_ERRORS if has_errors(problems) else OK)
        counts = {severity: sum(each.severity is severity for each in problems) for severity in Severity}
        found = ", ".join(_count(number, severity) for severity, number in counts.items() if number)
        printing.show(
            {
                "file": file.name,
                "kind": file.kind,
                "programs": file.programs,
                "problems": [as_data(each) for each in problems],
            },
            told(file.name, problems).append(f"{file.name}: {found or 'nothing is wrong'}, {_read_as(file)}"),
        )
    return code


def _count(number: int, severity: Severity) -> str:
    return f"{number} {severity.value}{'s' * (number > 1)}"


def _read_as(file: NamedFile) -> str:
    if file.kind != "program":
        return f"read as {file.kind}"
    names = ", ".join(f"O{number:05d}" for number in file.programs[:5])
    more = len(file.programs) - 5
    return f"programs {names}{f' and {more} more' if more > 0 else ''}" if names else "no program with a name"


@moves_nothing
def compare(
    before: ControlFile,
    after: Annotated[ControlFile, Parameter(name="AFTER")],
    *,
    kind: KindOption = None,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Say in what two files differ that matters; without a machine.

    Numbered data by their numbers, with names where they are known; N0 does not count, nor do blanks. Programs by
    their numbers: the first block in which each differs. Exits with 1 if they differ, with 0 if not.

    ```sh
    compax haas diff "settings monday.txt" "settings tuesday.txt"
    compax haas diff yesterday.nc today.nc --json
    ```
    """
    files = [read_file(each, kind) for each in (before, after)]
    name, (left, right) = _comparable(files)
    differences = diff(left, right)
    said = [str(each) for each in differences]
    summary = f"{len(said)} difference{'s' * (len(said) != 1)}, read as {name}" if said else f"no difference, as {name}"
    printing.show(
        {
            "before": files[0].name,
            "after": files[1].name,
            "kind": name,
            "differences": [_difference(each) for each in differences],
        },
        Text("\n".join([*map(escaped, said), summary])),
    )
    return _DIFFER if differences else OK


def _comparable(files: list[NamedFile]) -> tuple[str, list[DataFile | ProgramFile]]:
    """
    Read both as what either is known to be.

    Raises:
        InvalidCommandError: They are different things, or damaged.
    """
    kinds = {each.kind for each in files} - {None}
    if len(kinds) > 1 or ("program" in kinds and any(each.kind is None for each in files)):
        first, second = (each.kind or _UNKNOWN for each in files)
        raise InvalidCommandError(f"{first} and {second} cannot be compared", hint="--kind says what both are")
    known = next(iter(kinds), None)
    if known == "program":
        return "programs", [parse_program_file(each.data) for each in files]
    # Of numbers that nothing is known of, none has a name; parameters have none.
    data_kind = DataKind(known) if known else DataKind.PARAMETERS
    return known or _UNKNOWN, [_parsed(each, data_kind) for each in files]


def _parsed(file: NamedFile, kind: DataKind) -> DataFile:
    try:
        return parse_data_file(file.data, kind)
    except InvalidCommandError as error:
        error.device = file.name
        raise


def _difference(each: Difference) -> dict[str, Any]:
    return {
        "number": each.number,
        "name": each.name,
        "how": each.how.value,
        "before": each.before,
        "after": each.after,
        "before_line": each.before_line,
        "after_line": each.after_line,
    }

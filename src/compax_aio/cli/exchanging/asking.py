"""``compax haas query``: what a control says of itself, asked one thing after the other, as slowly as it bears."""

from __future__ import annotations

from datetime import timedelta
from typing import Annotated, Any, Final

from cyclopts import Parameter
from rich.table import Table
from rich.text import Text

from compax_aio import AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError
from compax_aio.escaping import escaped
from compax_aio.haas.answers import Answer, Busy, ProgramStatus, Request
from compax_aio.haas.facts.queries import QUERIES
from compax_aio.haas.facts.variables import VARIABLES

from ..exit_codes import OK, exit_code_of
from ..interruption import moves_nothing
from ..printing import Printing
from .line import ControlLine, ControlUrl, SetUp

__all__ = ["Question", "meaning_of", "query", "request_of", "value_as_json", "value_in_words"]

Question = Annotated[
    str,
    Parameter(name="WHAT", help="Q100, Q500 …, or the number of a variable: 3027; all known questions if not given."),
]

_USUAL: Final = tuple(each for each, row in QUERIES.items() if not row.takes_variable)
_WHY_SILENT: Final = (
    "is Setting 143 (MACHINE DATA COLLECT) on, and the control switched on? Compare Settings 11 (baud rate), 12 "
    "(parity), 13 (stop bits) and 37 (data bits) with --profile; some controls want a question mark: --profile "
    "data-collection-115200. One that waits for the rest of a file takes questions for it: press RESET there"
)


@moves_nothing
async def query(
    url: ControlUrl,
    *what: Question,
    set_up: SetUp = SetUp(),  # noqa: B008 - it is frozen
    line: ControlLine = ControlLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Ask a control for serial number, mode, program, parts, times, and variables (Setting 143 must be on).

    It is asked one thing after the other, with pauses: a control that was polled without pause has frozen. While a
    cycle runs it says that it is busy, which is a state, and no error. Positions and loads are variables; which there
    are depends on the control.

    ```sh
    compax haas query serial:///dev/ttyUSB0
    compax haas query serial:///dev/ttyUSB0 Q500 3027 5021
    compax haas query tcp://192.168.1.60:5051 Q100 --profile next-generation --json
    ```
    """
    profile = set_up.known()
    requests = [request_of(each) for each in what or _USUAL]
    documents: list[dict[str, Any]] = []
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    code = OK
    async with line.open(url, profile) as control:
        for request in requests:
            try:
                answer = await control.query(request.text)
            except (CommandRejectedError, UnexpectedAnswerError) as error:
                code = code or exit_code_of(error)
                said = f": {error.received!r}" if error.received is not None else ""
                documents.append(_document(request, None, None, f"{error.what}{said}"))
                words = Text(f"not said: {error.what}{said}", style="yellow")
            except AnswerTimeoutError as error:
                error.hint = _WHY_SILENT
                raise
            else:
                value = getattr(answer, "value", answer)
                documents.append(_document(request, value_as_json(value), answer.text, None))
                words = Text(value_in_words(value))
            table.add_row(request.text, meaning_of(request), words)
        name = control.name
    printing.show({"control": name, "answers": documents}, table)
    return code


def _document(request: Request, value: Any, text: str | None, error: str | None) -> dict[str, Any]:
    """Return an answer as programs read it; *text* is how the control has put it."""
    return {
        "question": request.text,
        "meaning": meaning_of(request),
        "value": value,
        "text": text,
        "error": error,
    }


def request_of(word: str) -> Request:
    """Read what is asked: ``Q500``, ``Q600 3027``, ``3027``; raises InvalidCommandError."""
    return Request.of_variable(int(word)) if word.isascii() and word.isdigit() else Request.of(word)


def meaning_of(request: Request) -> str:
    """Say what is asked, as far as that is known."""
    if request.variable is not None:
        row = VARIABLES.get(request.variable)
        return "a variable" if row is None else f"{row.name}{f' in {row.unit}' if row.unit else ''}"
    row_of_query = QUERIES.get(request.command)
    return "not known here" if row_of_query is None else row_of_query.meaning


def value_as_json(value: Any) -> Any:
    """Return a value as programs read it: times in seconds, a program status by its parts."""
    if isinstance(value, timedelta):
        return value.total_seconds()
    if isinstance(value, ProgramStatus):
        return {"busy": value.is_busy, "program": value.program, "status": value.status, "parts": value.parts}
    if isinstance(value, Busy):
        return {"busy": True}
    if isinstance(value, Answer):
        return list(value.fields)
    return value


def value_in_words(value: Any) -> str:
    """Return a value as people read it."""
    if value is None:
        return "empty (#0)"
    if isinstance(value, Answer):
        return escaped(_in_words(value))
    if isinstance(value, timedelta):
        minutes, seconds = divmod(int(value.total_seconds()), 60)
        return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d} h"
    if isinstance(value, float):
        return f"{value:.10g}"
    return escaped(str(value))


def _in_words(answer: Answer) -> str:
    if isinstance(answer, Busy) or (isinstance(answer, ProgramStatus) and answer.is_busy):
        return "busy: a cycle runs"
    if isinstance(answer, ProgramStatus):
        return f"{answer.program}, {answer.status}{'' if answer.parts is None else f', {answer.parts} parts'}"
    return answer.text

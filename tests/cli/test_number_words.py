"""Numbers among the words of a command are read as they are written, or refused; none is rounded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, get_args, get_origin

import pytest
from cyclopts import App, Argument, CycloptsError

from compax_aio.cli.app import app, run
from compax_aio.cli.number_words import NUMBER, WHOLE


def commands(group: App, names: tuple[str, ...] = ()) -> Iterator[tuple[str, App]]:
    """Give every command with a name that can be called, below *group* as well."""
    for name in group:
        if not name.startswith("-"):
            below = group[name]
            if below.default_command is not None:
                yield " ".join((*names, name)), below
            yield from commands(below, (*names, name))


def kinds(hint: Any) -> set[Any]:
    """Give the kinds of which a value is made: float of ``float | None``."""
    return {hint} if get_origin(hint) is None else {kind for each in get_args(hint) for kind in kinds(each)}


ARGUMENTS = [(name, each) for name, command in commands(app) for each in command.assemble_argument_collection()]


@pytest.mark.parametrize(("kind", "how"), [(int, WHOLE), (float, NUMBER)])
def test_every_number_of_every_command_is_read_so(kind: type, how: Any) -> None:
    found = [(name, each) for name, each in ARGUMENTS if kind in kinds(each.hint)]
    assert len(found) > 10
    read_otherwise = [(name, each.name) for name, each in found if not _is_read_by(each, how)]
    assert not read_otherwise, "write Annotated[…, WHOLE] or Annotated[…, NUMBER]"


def _is_read_by(argument: Argument, how: Any) -> bool:
    return argument.parameter.converter is how.converter


@pytest.fixture
def reader() -> App:
    reader = App(result_action="return_value")

    @reader.default
    def told(
        *,
        whole: Annotated[int | None, WHOLE] = None,
        several: Annotated[tuple[int, ...], WHOLE] = (1, 2),
        optional: Annotated[tuple[int, ...] | None, WHOLE] = None,
        number: Annotated[float | None, NUMBER] = None,
    ) -> tuple[Any, ...]:
        return whole, several, optional, number

    return reader


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("", (None, (1, 2), None, None)),
        ("--whole 0800 --several 5 --several=-6", (800, (5, -6), None, None)),
        ("--optional 5", (None, (1, 2), (5,), None)),
        ("--number=-1.5e-3", (None, (1, 2), None, -0.0015)),
        ("--number=+.5", (None, (1, 2), None, 0.5)),
        ("--number 7.", (None, (1, 2), None, 7.0)),
    ],
)
def test_numbers_are_read_as_they_are_written(words: str, read: tuple[Any, ...], reader: App) -> None:
    assert reader(words) == read


@pytest.mark.parametrize("text", ["800.5", "800.0", "1e3", "0x10", "1_000", "٣", "", "9" * 5000, "1-2"])
def test_what_is_no_whole_number_is_refused(text: str, reader: App) -> None:
    for option in ("--whole", "--several"):
        with pytest.raises(CycloptsError, match="no whole number"):
            reader([f"{option}={text}"], exit_on_error=False, print_error=False)


@pytest.mark.parametrize("text", ["nan", "-inf", "1e999", "1_0", "1,5", "٣", "", ".", "5 mm", "0x1p3"])
def test_what_is_no_number_is_refused(text: str, reader: App) -> None:
    with pytest.raises(CycloptsError, match="no number"):
        reader([f"--number={text}"], exit_on_error=False, print_error=False)


@pytest.mark.parametrize(
    "words",
    [
        "move serial:///dev/nowhere 1_0",
        "move serial:///dev/nowhere 10 --acceleration-ms 800.5",
        "program run serial:///dev/nowhere --from 1.5",
        "smc run serial:///dev/nowhere X 800.5",
        "sim compax --tcp 4001.5",
        "replay nowhere.jsonl --from nan",
    ],
)
def test_commands_refuse_it_by_their_words(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words.split()) == 2
    assert "number" in capsys.readouterr().err

"""Tables of the states of each line and of what leads where, made from the code when the documents are built."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from functools import partial
from typing import Any, Final

from sphinx.application import Sphinx
from table_making import Cell, Table, add_tables, code, field_docstrings

from compax_aio.camm1 import protocol_states as camm1
from compax_aio.compax.protocol_states import TRANSITIONS, State
from compax_aio.haas import protocol_states as haas
from compax_aio.smc import protocol_states as smc

__all__ = ["TABLES", "setup"]


def _states() -> Table:
    return ("state", "meaning"), [(code(state.name), state.value) for state in State]


def _transitions() -> Table:
    events = dict.fromkeys(event for _, event in TRANSITIONS)
    rows: list[Sequence[Cell]] = []
    for event in events:
        after = [TRANSITIONS.get((state, event)) for state in State]
        rows.append((event.__name__.lstrip("_"), *("" if state is None else code(state.name) for state in after)))
    return ("event \\ in state", *(code(state.name) for state in State)), rows


def _sibling_states(states: type[Enum]) -> Table:
    meanings = dict(field_docstrings(states))
    return ("state", "meaning"), [(code(state.name), meanings[state.name]) for state in states]


def _sibling_transitions(states: type[Enum], table: Mapping[tuple[Any, Any], Enum]) -> Table:
    """Tell what an event does in most states in one row, and each of the others in its own."""
    rows: list[Sequence[Cell]] = []
    for step in dict.fromkeys(step for _, step in table):
        after = {state: table[state, step] for state in states if (state, step) in table}
        usual, count = Counter(after.values()).most_common(1)[0]
        others = {state: then for state, then in after.items() if then is not usual}
        if len(after) == len(states) and count > len(states) / 2:
            rows.append((step.value, f"any but {_names(others)}" if others else "any", code(usual.name)))
            after = others
        rows += [(step.value, code(state.name), code(then.name)) for state, then in after.items()]
    return ("event", "in state", "leads to"), rows


def _names(states: Iterable[Enum]) -> str:
    return ", ".join(state.name for state in states)


TABLES: Final[Mapping[str, Callable[[], Table]]] = {
    "table-of-states": _states,
    "table-of-transitions": _transitions,
    "table-of-smc-states": partial(_sibling_states, smc.State),
    "table-of-smc-transitions": partial(_sibling_transitions, smc.State, smc.TRANSITIONS),
    "table-of-camm1-states": partial(_sibling_states, camm1.State),
    "table-of-camm1-transitions": partial(_sibling_transitions, camm1.State, camm1.TRANSITIONS),
    "table-of-haas-states": partial(_sibling_states, haas.State),
    "table-of-haas-transitions": partial(_sibling_transitions, haas.State, haas.TRANSITIONS),
}
"""By the directive that puts each in place."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Add a directive for each table."""
    add_tables(app, TABLES)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

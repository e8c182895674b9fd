"""What users of controls need is found in one place, and nothing is imported before it is asked for."""

from __future__ import annotations

import ast
import inspect

import pytest

from compax_aio import haas


def test_every_name_is_there() -> None:
    assert all(getattr(haas, name) is not None for name in haas.__all__)
    assert {name for names in haas._HOMES.values() for name in names} == set(haas.__all__)
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        haas.nothing_of_the_kind  # noqa: B018


def test_the_names_of_the_contract_are_there() -> None:
    assert {"connect", "Control", "Received", "Sent", "Transfer", "TransferAccount"} <= set(haas.__all__)
    for name in ("receive_program", "send_program", "receive_settings", "query", "drip_feed", "watch"):
        assert callable(getattr(haas.Control, name))


def test_what_types_are_told_is_what_is_imported_when_it_is_asked_for() -> None:
    source = ast.parse(inspect.getsource(haas))
    (told,) = (each for each in source.body if isinstance(each, ast.If))
    homes = {
        f"{'.' * each.level}{each.module}": tuple(alias.name for alias in each.names)
        for each in told.body
        if isinstance(each, ast.ImportFrom)
    }
    assert {home: set(names) for home, names in homes.items()} == {
        home: set(names) for home, names in haas._HOMES.items()
    }

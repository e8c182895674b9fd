"""The public surface is a list, and the errors are one tree."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import compax_aio
from compax_aio import errors
from compax_aio.camm1.cutting import _AbortAskedError
from compax_aio.motion.one_move import MustStop

MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(compax_aio.__path__, "compax_aio.")
    if not module.name.startswith("compax_aio.cli") and not module.name.endswith("__main__")
)
"""All modules but those of the command line, which needs an extra."""

NEVER_LEAVE_THEIR_ROOM = {MustStop, _AbortAskedError}

NOT_NEEDED = [
    *("rich", "numpy", "matplotlib", "serialx", "textual", "prompt_toolkit", "cyclopts", "uvloop", "trustme"),
    *("hypothesis", "pytest", "compax_aio.simulator", "compax_aio.cli", "serial", "serial_asyncio"),
]


def natural(name: str) -> list[tuple[str, int]]:
    """Have numbers sorted by their value, as ruff does: ``PNC_900`` before ``PNC_1050``."""
    return [(letters, int(digits or 0)) for letters, digits in re.findall(r"(\D+|^)(\d*)", name)]


def public_classes(module: ModuleType) -> list[type]:
    return [each for each in vars(module).values() if isinstance(each, type) and each.__module__ == module.__name__]


def test_what_the_package_offers_is_what_it_has() -> None:
    offered = compax_aio.__all__
    assert sorted(offered) == list(offered), "in the order in which people look"
    assert len(set(offered)) == len(offered)
    assert dir(compax_aio) == offered
    assert all(getattr(compax_aio, name).__name__ == name for name in offered)
    assert not hasattr(compax_aio, "nothing_of_the_kind")


def test_what_types_are_told_of_the_package_is_what_is_imported_when_it_is_asked_for() -> None:
    source = ast.parse(inspect.getsource(compax_aio))
    (told,) = (each for each in source.body if isinstance(each, ast.If))
    homes = {
        alias.name: f".{each.module}" for each in told.body if isinstance(each, ast.ImportFrom) for alias in each.names
    }
    assert homes == compax_aio._HOMES
    assert {*homes, *errors.__all__} == set(compax_aio.__all__)


def test_the_names_of_the_contract_are_offered() -> None:
    """Section 5 of the design."""
    assert {"connect", "Drive", "DriveGroup", "DriveSettings", "Move", "MoveResult"} <= set(compax_aio.__all__)
    assert set(errors.__all__) <= set(compax_aio.__all__)


@pytest.mark.parametrize("name", MODULES)
def test_every_module_lists_what_it_offers(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__
    if hasattr(module, "__path__") and not hasattr(module, "__all__"):
        return  # a package that offers nothing itself
    offered = module.__all__
    assert list(offered) == sorted(offered, key=lambda each: (not each.isupper(), each[0].islower(), natural(each)))
    assert all(hasattr(module, each) for each in offered)


def test_the_types_of_the_package_are_shipped() -> None:
    assert (Path(compax_aio.__path__[0]) / "py.typed").exists()


def test_importing_the_package_imports_nothing_that_it_does_not_need() -> None:
    """In a process of its own, for this one has imported all."""
    assert imported_by("import compax_aio", [*NOT_NEEDED, "asyncio", "compax_aio.compax", "compax_aio.link"]) == []
    assert imported_by("from compax_aio import *", NOT_NEEDED) == []


def imported_by(statement: str, names: list[str]) -> list[str]:
    code = f"import sys\n{statement}\nprint(*[name for name in {names!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.split()


# Errors ---------------------------------------------------------------------------------------------------------------


def test_the_errors_are_one_tree_of_at_most_fifteen() -> None:
    classes = public_classes(errors)
    assert {each.__name__ for each in classes} == set(errors.__all__)
    assert len(classes) <= 15
    assert all(issubclass(each, errors.CompaxError) for each in classes)


def test_nothing_that_users_call_has_an_exception_outside_the_tree() -> None:
    for name in MODULES:
        if name.startswith("compax_aio.simulator."):
            continue  # the far end raises within itself
        for each in public_classes(importlib.import_module(name)):
            is_of_the_tree = name == "compax_aio.errors"
            assert not issubclass(each, BaseException) or is_of_the_tree or each in NEVER_LEAVE_THEIR_ROOM, each


def test_errors_that_programmers_know_are_what_they_know() -> None:
    assert issubclass(errors.InvalidCommandError, ValueError)
    assert issubclass(errors.MoveActiveError, errors.MoveError)
    assert issubclass(errors.ConnectionLostError, errors.TransportError)
    assert not issubclass(errors.AnswerTimeoutError, TimeoutError), "asyncio.timeout() around a call must stay apart"


def test_an_error_says_where_what_and_what_to_do() -> None:
    error = errors.CommandRejectedError(
        "the drive rejected it", device="x", sent="PA1", received="E92", hint="await it", code=92, exchanges=("a",)
    )
    assert str(error) == "x: the drive rejected it; sent 'PA1'; received 'E92'; await it"
    assert (error.what, error.code, error.exchanges) == ("the drive rejected it", 92, ("a",))
    assert str(errors.CompaxError("nothing more")) == "nothing more"
    assert str(errors.CompaxError("nothing", sent="", received="")) == "nothing; sent ''; received ''"

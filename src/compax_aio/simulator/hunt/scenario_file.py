"""Scenarios as JSON: what was found once is kept as it was, however later scenarios are drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from compax_aio.compax.protocol_events import MessageForm
from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax.knobs import Knobs

from .scenario import Action, DrivePlan, Scenario, Trouble

__all__ = ["read_scenario", "scenario_text"]

_BYTES: Final = "bytes"
_FORM: Final = "message form"


def scenario_text(scenario: Scenario, about: str) -> str:
    """
    Write *scenario* as JSON; what is as usual is left out.

    Args:
        scenario: All of it, or what it was shrunk to.
        about: What it is about, for people.
    """
    parts = {
        "about": about,
        "seed": scenario.seed,
        "drives": [_drive(plan) for plan in scenario.drives],
        "actions": [_others(action) for action in scenario.actions],
        "troubles": [_others(trouble) for trouble in scenario.troubles],
    }
    return json.dumps(parts, indent=1, default=_odd) + "\n"


def read_scenario(path: Path) -> tuple[str, Scenario]:
    """Read what :func:`scenario_text` has written: what it is about, and the scenario."""
    parts = _plain(json.loads(path.read_text("utf-8"), object_hook=_of_odd))
    return parts["about"], Scenario(
        seed=parts["seed"],
        drives=tuple(
            DrivePlan(**{**plan, "knobs": Knobs(**plan["knobs"]), "settings": DriveSettings(**plan["settings"])})
            for plan in parts["drives"]
        ),
        actions=tuple(Action(**action) for action in parts["actions"]),
        troubles=tuple(Trouble(**trouble) for trouble in parts["troubles"]),
    )


def _drive(plan: DrivePlan) -> dict[str, Any]:
    return {
        "number": plan.number,
        "axis": plan.axis,
        "knobs": _differences(plan.knobs, Knobs()),
        "settings": _differences(plan.settings, DriveSettings()),
        "left_over": plan.left_over,
    }


def _differences(value: Any, usual: Any) -> dict[str, Any]:
    return {name: given for name in type(value).__slots__ if (given := getattr(value, name)) != getattr(usual, name)}


def _others(item: Action | Trouble) -> dict[str, Any]:
    names = ("number", "at_s", "kind", "axes", "arguments", "gives_up", "lasts_s")
    return {name: getattr(item, name) for name in names if hasattr(item, name)}


def _odd(value: object) -> dict[str, str]:
    if isinstance(value, MessageForm):
        return {_FORM: value.name}
    if isinstance(value, bytes):
        return {_BYTES: value.decode("latin-1")}
    raise TypeError(f"{value!r} has no place in a scenario")


def _of_odd(parts: dict[str, Any]) -> Any:
    if set(parts) == {_BYTES}:
        return parts[_BYTES].encode("latin-1")
    return MessageForm[parts[_FORM]] if set(parts) == {_FORM} else parts


def _plain(value: Any) -> Any:
    """Make tuples of all lists: a scenario is never changed."""
    if isinstance(value, list):
        return tuple(map(_plain, value))
    return {name: _plain(part) for name, part in value.items()} if isinstance(value, Mapping) else value

"""Draws a whole scenario of a party line from one seed, before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Any, Final

from compax_aio.simulator.smc.knobs import Knobs
from compax_aio.smc.profile import DCB_274, IM483I, Profile
from compax_aio.smc.settings import SmcSettings

from ..hunt.scenario import Action, Trouble
from .actions import ACTIONS
from .scenario import AxisPlan, LinePlan, PartyScenario
from .troubles import LASTS_S, TROUBLES

__all__ = ["AXIS_APART", "base_of", "draw_party"]

AXIS_APART: Final = 20_000.0
"""Positions tell which axis they are of."""
_LIMITS: Final = 5_000.0
"""Steps from where an axis begins to its limit switches."""
_HOME: Final = 400.0
"""And to its home switch, toward minus."""
_APART_S: Final = 1e-7
"""No two things happen at the very same time: which of them is first an event loop does not say."""
_NAMES: Final = ("ABCDE", "ABCDE", "XYZab", "mCqke", "RstKv")
_CHANCE_OF_A_KNOB: Final = 0.06
_CHANCE_OF_RECONNECTING: Final = 0.5
_CHANCE_OF_SLOW_STEPPING: Final = 0.08
"""That an axis which steps reads slower than others are spoken to, and loses what is not for it (not documented)."""

_OTHER_KNOBS: Final[dict[str, tuple[Any, ...]]] = {
    "echo_leading_lf": (True,),
    "abort_echo": ("all",),
    "collision": ("garble", "first"),
    "uart_depth": (2, 16),
    "overrun": ("drop",),
    "idle_service_s": (0.00005, 0.003),
    "jitter": (0.3, 1.0),
    "execution_time_s": (0.0, 0.02),
    "overlong": ("beep", "abort"),
    "half_entered": ("clear", "clear"),
    "backspace": ("back",),
    "sign_on": ("ams-pre-1.14", "mcpherson-2.55"),
    "sign_on_prompt": ("none", "bare", "framed"),
    "prompt": ("bare",),
    "reset_time_s": (0.02, 0.4),
    "reset_keeps_position": (True,),
    "width": (0, 5, 14),
    "unknown": ("?", "#", "nothing"),
    "out_of_range": ("ignore", "error"),
    "second_action": ("reject",),
    "during_program": ("deaf",),
    "initial_speed": (20, 3000),
    "slew_speed": (500, 10_000),
    "ramp_slope": (0, 60),
    "hunt_time_s": (0.03, 0.4),
    "wait_unit_s": (0.001,),
}
"""What each knob may be besides its default."""


def base_of(place: int) -> float:
    """Return where the axis at that place of the line has its positions; the first one at zero, as after a reset."""
    return AXIS_APART * place


def draw_party(seed: int) -> PartyScenario:
    """Draw the scenario of *seed*; most are short, so that what they find is easy to read."""
    random = Random(f"smc/{seed}")
    mode = random.choices(("party", "daisy", "single"), (80, 10, 10))[0]
    names = random.choice(_NAMES)[: 1 if mode == "single" else random.choices((1, 2, 3, 4, 5), (35, 35, 18, 8, 4))[0]]
    if mode == "daisy":
        names = "ABCDE"[: len(names)]
    reconnecting = random.random() < _CHANCE_OF_RECONNECTING
    line = _line(Random(f"smc/{seed}/line"), mode, names, reconnecting=reconnecting)
    axes = tuple(_axis(place, name, line.knobs, random.random() < 0.5) for place, name in enumerate(names))
    first = 1 + len(axes)
    heavy = random.random() < 0.04
    actions = _actions(random, names, first, random.randint(8, 20) if heavy else random.randint(1, 6), mode)
    count = random.randint(4, 10) if heavy else random.choices((0, 1, 2, 3, 4), (12, 32, 30, 16, 10))[0]
    troubles = _troubles(random, names, actions, (first + len(actions), count), reconnecting=reconnecting)
    return PartyScenario(seed=seed, line=line, drives=axes, actions=actions, troubles=troubles)


# The line and its axes --------------------------------------------------------------------------------------------


def _line(random: Random, mode: str, names: str, *, reconnecting: bool) -> LinePlan:
    knobs: dict[str, Any] = {
        name: random.choice(others) for name, others in _OTHER_KNOBS.items() if random.random() < _CHANCE_OF_A_KNOB
    }
    if random.random() < 0.35:
        knobs["half_entered"] = "clear"
    if random.random() < 0.3:
        knobs["baudrate"] = random.choice((9600, 9600, 19200, 4800))
    if random.random() < 0.3:
        knobs["decimals"] = 2
    if random.random() >= _CHANCE_OF_SLOW_STEPPING:
        knobs["stepping_service_s"] = knobs.get("idle_service_s", Knobs().idle_service_s)
    profile = replace(IM483I, commands=IM483I.commands | frozenset("QJW")) if random.random() < 0.4 else DCB_274
    profile = replace(
        profile,
        decimals=knobs.get("decimals", 0),
        reset_time_s=knobs.get("reset_time_s", 0.15) + random.choice((0.05, 0.05, 0.6)),
        first_look_after_home_s=random.choice((0.3, 0.3, 1.0)),
    )
    return LinePlan(
        number=0,
        knobs=Knobs(mode=mode, axes=names, **knobs),  # type: ignore[arg-type]
        settings=_settings(random, profile, reconnecting=reconnecting),
        is_told_axes=random.random() < 0.85,
    )


def _settings(random: Random, profile: Profile, *, reconnecting: bool) -> SmcSettings:
    return SmcSettings(
        profile=profile,
        echo_timeout_s=random.choice((0.1, 0.1, 0.25)),
        answer_timeout_s=random.choice((0.4, 0.4, 1.0, 2.0)),
        quiet_s=random.choice((0.05, 0.05, 0.1)),
        resync_attempts=random.choice((6, 6, 3, 2)),
        cancel_with="escape" if random.random() < 0.15 else "line feed",
        poll_slowest_s=random.choice((0.25, 0.25, 0.1)),
        stop_timeout_s=random.choice((3.0, 3.0, 1.0)),
        standstill_timeout_s=3.0,
        stall_timeout_s=random.choice((3.0, 2.0)),
        in_doubt_after_s=random.choice((3.0, 1.0)),
        reconnect=reconnecting,
        reconnect_first_s=random.choice((0.05, 0.2)),
        reconnect_slowest_s=random.choice((0.3, 1.0)),
        reconnect_attempts=random.choice((None, None, None, 3)),
    )


def _axis(place: int, name: str, knobs: Knobs, is_away: bool) -> AxisPlan:
    """Plan an axis; half of the first ones stand at zero, where a reset does not show."""
    base = base_of(place)
    position = base + 500.0 if is_away else base
    own = replace(knobs, position=position, home=base - _HOME, limit_min=base - _LIMITS, limit_max=base + _LIMITS)
    return AxisPlan(number=1 + place, axis=name, knobs=own)


# Actions ----------------------------------------------------------------------------------------------------------


def _actions(random: Random, names: str, first: int, count: int, mode: str) -> tuple[Action, ...]:
    kinds = [kind for kind, what in ACTIONS.items() if mode in what.modes]
    weights = [ACTIONS[kind].weight for kind in kinds]
    at_s = dict.fromkeys(names, 1.0)
    actions = []
    for number in range(first, first + count):
        (kind,) = random.choices(kinds, weights)
        axis = random.choice(names)
        begins_s = at_s[axis]
        at_s[axis] = begins_s + random.choice((0, 0, 0.002, 0.03, 0.2, 0.6, 1.5, 3.0))
        gives_up: tuple[float, int] | None = None
        if random.random() < 0.2:
            after_s: float = random.choice((0, 0, 0.00107, 0.00413, 0.0207, 0.153, 0.507))
            gives_up = (after_s, random.randint(0, 12))
        actions.append(
            Action(
                number=number,
                at_s=begins_s + random.choice((0, 0, 0.0005, 0.003)) + number * _APART_S,
                kind=kind,
                axes=() if ACTIONS[kind].of_line else (axis,),
                arguments=ACTIONS[kind].draw(random, number, base_of(names.index(axis))),
                gives_up=gives_up,
            )
        )
    return tuple(actions)


# Troubles ---------------------------------------------------------------------------------------------------------

_CHANCE_OF_EARLY_TROUBLE: Final = 0.04
"""That it comes while the line is opened."""
_AFTERWARDS_S: Final = (0, 0.001, 0.002, 0.004, 0.008, 0.02, 0.1, 0.4, 1.0)
"""About so long after an action begins a trouble comes: most near the bytes that matter."""


def _troubles(
    random: Random, names: Sequence[str], actions: tuple[Action, ...], numbers: tuple[int, int], *, reconnecting: bool
) -> tuple[Trouble, ...]:
    first, count = numbers
    kinds = list(TROUBLES)
    weights = [what.weight + reconnecting * what.reconnecting for what in TROUBLES.values()]
    troubles = []
    for number in range(first, first + count):
        at_s = random.choice(actions).at_s + random.choice(_AFTERWARDS_S) * random.random() * 2
        if random.random() < _CHANCE_OF_EARLY_TROUBLE:
            at_s = random.choice((0.0, 0.001, 0.01, 0.1))
        (kind,) = random.choices(kinds, weights)
        troubles.append(
            Trouble(
                number=number,
                at_s=at_s + number * _APART_S,
                kind=kind,
                axes=(random.choice(names),) if TROUBLES[kind].of_axis else (),
                arguments=TROUBLES[kind].draw(random),
                lasts_s=random.choice(LASTS_S),
            )
        )
    return tuple(troubles)

"""Draws a whole scenario from one seed, before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any, Final

from compax_aio.compax.protocol_events import MessageForm
from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax.knobs import Knobs

from .actions import ACTIONS
from .scenario import Action, DrivePlan, Scenario, Trouble
from .troubles import LASTS_S, TROUBLES

__all__ = ["AXIS_APART", "draw_drive", "draw_scenario", "draw_trouble"]

_AXES: Final = "xyzw"
AXIS_APART: Final = 1000.0
"""Positions tell which axis they are of."""

_APART_S: Final = 1e-7
"""No two things happen at the very same time: which of them is first an event loop does not say."""

_OTHER_KNOBS: Final[dict[str, tuple[Any, ...]]] = {
    "error_style": ("text", "prompt_only", "silent"),
    "position_reached": ("final_only",),
    "position_reached_on_stop": (True,),
    "position_reached_on_home": (False,),
    "comparator_messages": ("with_sign",),
    "comparator_form": ("prompt_first",),
    "comparator_numbering": ("points",),
    "reply_padding": ("blanks", "unit"),
    "decimals": (3,),
    "status_bits_blank": (True,),
    "fault_numbers": ("one",),
    "echo_sign": ("echo_only",),
    "store": ("until_next_line",),
    "long_line": ("truncate",),
    "echo": (True,),
    "power_on_text": ("prompt", "banner"),
    "lower_case": ("error",),
    "ready_after_answer": (True,),
    "xonxoff": (True,),
    "password": ("off",),
    "vp": ("at_once",),
    "parameter_reading": ("valid",),
    "trailing_zeros": ("all", "none"),
    "answer_time_s": (0.0005, 0.01, 0.05),
    "record_time_s": (0.01,),
    "self_test_s": (0.5,),
    "nominal_speed": (50.0, 1000.0),
    "speed_percent": (50.0,),
    "acceleration_ms": (0, 50, 1000),
    "stop_ramp_ms": (0, 20, 400),
    "machine_zero": (25.0, -40.0),
    "following_error_factor": (0.0, 0.01),
}
"""What each knob may be besides its default."""

_CHANCE_OF_A_KNOB: Final = 0.05
_CHANCE_OF_A_MESSAGE_TOO_MANY: Final = 0.1
_CHANCE_OF_MACHINE_ZERO: Final = 0.3
_CHANCE_OF_RECONNECTING: Final = 0.55
"""That the lines of a scenario are opened again when they are lost, and more is done to them."""
_HALF_LINES: Final = (b"PA5", b"POSR 1", b"S", b"PA100$", b"SD")


def draw_scenario(seed: int) -> Scenario:
    """Draw the scenario of *seed*; most are short, so that what they find is easy to read."""
    random = Random(seed)
    reconnecting = random.random() < _CHANCE_OF_RECONNECTING
    heavy = random.random() < 0.04
    axes = _AXES[: random.choices((1, 2, 3, 4), (55, 28, 14, 3))[0]]
    drives = tuple(
        draw_drive(number, axis, Random(f"{seed}/drive/{axis}"), reconnecting=reconnecting)
        for number, axis in enumerate(axes)
    )
    actions = _actions(random, axes, len(drives), random.randint(12, 30) if heavy else random.randint(1, 7))
    count = random.randint(4, 12) if heavy else random.choices((0, 1, 2, 3, 4), (12, 30, 30, 18, 10))[0]
    troubles = _troubles(random, axes, actions, (len(drives) + len(actions), count), reconnecting=reconnecting)
    return Scenario(seed=seed, drives=drives, actions=actions, troubles=troubles)


# Drives -----------------------------------------------------------------------------------------------------------


def draw_drive(number: int, axis: str, random: Random, *, usual: bool = False, reconnecting: bool = False) -> DrivePlan:
    """Draw a drive, its ways, and how the client is set up for it; a *usual* one has the ways that are likeliest."""
    knobs: dict[str, Any] = {"position": AXIS_APART * number}
    if usual:
        settings = DriveSettings(answer_timeout_s=0.5, reconnect=reconnecting)
        return DrivePlan(number=number, axis=axis, knobs=Knobs(**knobs), settings=settings)
    knobs |= {
        name: random.choice(others) for name, others in _OTHER_KNOBS.items() if random.random() < _CHANCE_OF_A_KNOB
    }
    if random.random() < _CHANCE_OF_A_MESSAGE_TOO_MANY:
        knobs["position_reached_on_stop"] = True
    if random.random() < 0.08:
        knobs["baudrate"] = random.choice((9600, 4800))
    binary = random.random() < 0.05
    if binary:
        knobs["p20"] = 16
    left_over = random.choice(_HALF_LINES) if random.random() < 0.08 else b""
    settings = _settings(random, knobs, binary=binary, reconnecting=reconnecting)
    if random.random() < _CHANCE_OF_MACHINE_ZERO:  # which a drive forgets that is switched off, and so shows it
        knobs["homed"] = True
    return DrivePlan(number=number, axis=axis, knobs=Knobs(**knobs), settings=settings, left_over=left_over)


def _settings(random: Random, knobs: dict[str, Any], *, binary: bool, reconnecting: bool) -> DriveSettings:
    message_form: MessageForm = MessageForm.UNKNOWN
    if random.random() < 0.2:
        only = knobs.get("position_reached") == "final_only"
        message_form = MessageForm.FINAL_ONLY if only else MessageForm.PROMPT_FIRST
    return DriveSettings(
        answer_timeout_s=random.choice((0.3, 0.3, 0.3, 0.5, 1.0)),
        resync_attempts=random.choice((3, 3, 1, 5)),
        decimals=knobs.get("decimals", 2),
        message_form=message_form,
        # What these are for is told where they are defined; a drive that needs one and has it not deceives itself.
        verify_messages=random.random() < 0.15 or "position_reached_on_stop" in knobs,
        message_when_prepared=random.random() < 0.4,
        binary_settings=binary,
        binary_motion=binary and random.random() < 0.5,
        poll_first_s=random.choice((0.1, 0.1, 0.02)),
        poll_slowest_s=random.choice((0.5, 0.5, 0.1)),
        stall_timeout_s=random.choice((3.0, 2.0)),
        in_doubt_after_s=random.choice((3.0, 1.0)),
        stop_timeout_s=random.choice((3.0, 1.0)),
        standstill_timeout_s=3.0,
        reconnect=reconnecting and random.random() < 0.9,
        reconnect_first_s=random.choice((0.05, 0.2)),
        reconnect_slowest_s=random.choice((0.3, 1.0)),
        reconnect_attempts=random.choice((None, None, None, 3)),
    )


# Actions ----------------------------------------------------------------------------------------------------------


def _actions(random: Random, axes: str, first: int, count: int) -> tuple[Action, ...]:
    kinds = list(ACTIONS)
    weights = [ACTIONS[kind].weight for kind in kinds]
    at_s = dict.fromkeys(axes, 0.5)
    actions = []
    for number in range(first, first + count):
        (kind,) = random.choices(kinds, weights)
        what = ACTIONS[kind]
        ours = tuple(random.sample(axes, random.randint(1, len(axes)))) if what.of_group else (random.choice(axes),)
        begins_s = max(at_s[axis] for axis in ours)
        for axis in ours:
            at_s[axis] = begins_s + random.choice((0, 0, 0.002, 0.004, 0.03, 0.2, 0.6, 1.5, 4.0))
        gives_up: tuple[float, int] | None = None
        if random.random() < 0.2:
            after_s: float = random.choice((0, 0, 0.00107, 0.00213, 0.00411, 0.0207, 0.153, 0.507))
            gives_up = (after_s, random.randint(0, 12))
        actions.append(
            Action(
                number=number,
                at_s=begins_s + random.choice((0, 0, 0.0005, 0.003)) + number * _APART_S,
                kind=kind,
                axes=ours,
                arguments=what.draw(random, number, [_AXES.index(axis) * AXIS_APART for axis in ours]),
                gives_up=gives_up,
            )
        )
    return tuple(actions)


# Troubles ---------------------------------------------------------------------------------------------------------


def _troubles(
    random: Random, axes: str, actions: tuple[Action, ...], numbers: tuple[int, int], *, reconnecting: bool
) -> tuple[Trouble, ...]:
    first, count = numbers
    troubles = []
    spared = random.choice(axes) if len(axes) > 1 and random.random() < 0.6 else ""
    afflicted = [axis for axis in axes if axis != spared]
    for number in range(first, first + count):
        at_s = random.choice(actions).at_s + random.choice(_AFTERWARDS_S) * random.random() * 2
        if random.random() < _CHANCE_OF_EARLY_TROUBLE:
            at_s = random.choice((0.0, 0.001, 0.01))
        troubles.append(draw_trouble(random, number, at_s + number * _APART_S, afflicted, reconnecting=reconnecting))
    return tuple(troubles)


def draw_trouble(
    random: Random, number: int, at_s: float, axes: Sequence[str], *, reconnecting: bool = False
) -> Trouble:
    """Draw something that befalls one of *axes*."""
    kinds = list(TROUBLES)
    weights = [what.weight + reconnecting * what.reconnecting for what in TROUBLES.values()]
    (kind,) = random.choices(kinds, weights)
    return Trouble(
        number=number,
        at_s=at_s,
        kind=kind,
        axes=() if kind == "stall" else (random.choice(axes),),
        arguments=TROUBLES[kind].draw(random),
        lasts_s=random.choice(LASTS_S),
    )


_CHANCE_OF_EARLY_TROUBLE: Final = 0.04
"""That it comes while the line is opened."""
_AFTERWARDS_S: Final = (0, 0.001, 0.002, 0.004, 0.008, 0.02, 0.1, 0.4, 1.0)
"""About so long after an action begins a trouble comes: most near the bytes that matter."""

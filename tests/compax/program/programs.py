"""Programs to test with: the manual's own, and any that can be."""

from __future__ import annotations

from decimal import Decimal

from hypothesis import strategies as st

from compax_aio.compax.program import (
    Acceleration,
    Assign,
    Deceleration,
    End,
    Gosub,
    GosubExternal,
    Goto,
    GotoExternal,
    IfCompare,
    IfError,
    IfInputs,
    IfStop,
    Loop,
    MoveBy,
    MoveByCam,
    MoveHome,
    MoveTo,
    Outputs,
    Parameter,
    Password,
    Power,
    PreparedOutput,
    PreparedSpeed,
    Program,
    Record,
    Repeat,
    Return,
    Speed,
    SpeedSync,
    Status,
    Variable,
    Wait,
    WaitDistance,
    WaitPosition,
    WaitStart,
)

__all__ = ["MANUAL", "programs", "records"]

MANUAL = """\
N001: ACCEL 250
N002: SPEED 80
N003: REPEAT 10
N004: IF I7=1 GOTO 9
N005: WAIT 100
N006: END
N007: OUTPUT O7=1
N008: GOTO 13
N009: POSA 1250
N010: OUTPUT O8=1
N011: WAIT 500
N012: OUTPUT O8=0
N013: END
"""
"""UG p. 95."""

_variables = st.builds(Variable, st.integers(1, 39))
_named = _variables | st.builds(Parameter, st.integers(40, 49))


def _numbers(low: str, high: int, places: int) -> st.SearchStrategy[Decimal | Parameter | Variable]:
    return st.decimals(Decimal(low), high, allow_nan=False, allow_infinity=False, places=places) | _named


_positions = _numbers("-4000000", 4_000_000, 2)
_points = _numbers("0.01", 4_000_000, 2)
_ramps = _numbers("0", 65_000, 0)
_steps = _numbers("1", 600, 0)
_counts = _numbers("1", 8_388_607, 0)
_values = (
    st.decimals(-8_388_607, 8_388_607, places=6)
    | _variables
    | st.builds(Variable, st.integers(50, 70))
    | st.builds(Parameter, st.integers(1, 250))
    | st.builds(Status, st.integers(1, 39))
)
_targets = _variables | st.builds(Parameter, st.integers(1, 250))
_places = st.integers(1, 250)
_jumps: st.SearchStrategy[Goto | Gosub] = st.builds(Goto, _places) | st.builds(Gosub, _places)
_levels = st.lists(st.booleans(), min_size=1, max_size=8).map(tuple)
_first = st.integers(1, 9)

records: st.SearchStrategy[Record] = st.one_of(
    st.sampled_from(
        [SpeedSync(), MoveHome(), MoveByCam(), WaitStart(), GotoExternal(), GosubExternal(), Return(), End()]
    ),
    st.builds(Acceleration, _ramps),
    st.builds(Deceleration, _ramps),
    st.builds(Speed, _numbers("0.001", 600, 3), st.none() | _counts),
    st.builds(MoveTo, _positions),
    st.builds(MoveBy, _positions),
    st.builds(PreparedSpeed, _points, _steps, st.none() | _ramps),
    st.builds(PreparedOutput, _points, st.integers(1, 16), st.booleans()),
    st.builds(WaitPosition, _positions),
    st.builds(WaitDistance, _positions),
    st.builds(Wait, _counts),
    st.builds(Outputs, _first, _levels),
    st.builds(Power, st.integers(0, 2)),
    st.builds(Password, st.sampled_from([302, 270, 620])),
    _jumps,
    st.builds(Repeat, _counts),
    st.builds(Loop, _counts),
    st.builds(IfInputs, _first, _levels, _jumps),
    st.builds(IfError, _jumps),
    st.builds(IfStop, _jumps),
    st.builds(IfCompare, _values, st.sampled_from(["=", "<", ">", "<=", ">=", "<>"]), _values, _jumps),
    st.builds(Assign, _targets, _values),
    st.builds(Assign, _targets, _values, st.sampled_from(list("+-*/\\%")), _values),
)
"""Every record that the drive can be told."""

programs = st.dictionaries(_places, records, max_size=20).map(Program)

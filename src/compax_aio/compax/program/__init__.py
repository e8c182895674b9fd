"""
Programs of the drive's memory, N001-N250: read, checked and printed; no I/O (UG p. 95).

.. code-block:: python

    for problem in check(text):         # all that is wrong, with line and column
        print(problem)
    program = parse(text)               # records by number; InvalidCommandError if it cannot be read
    print(listing(program))             # long form, as in the manual
    lines = wire_lines(program)         # for the drive, at most 30 characters each
"""

from __future__ import annotations

from .check import check
from .printing import listing, record_text, wire_line, wire_lines
from .problems import Problem, Severity, raise_for_errors
from .reading import normalise, parse, parse_record
from .records import (
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
    Jump,
    Loop,
    MoveBy,
    MoveByCam,
    MoveHome,
    MoveTo,
    Number,
    Operand,
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
    Value,
    Variable,
    Wait,
    WaitDistance,
    WaitPosition,
    WaitStart,
)

__all__ = [
    "Acceleration",
    "Assign",
    "Deceleration",
    "End",
    "Gosub",
    "GosubExternal",
    "Goto",
    "GotoExternal",
    "IfCompare",
    "IfError",
    "IfInputs",
    "IfStop",
    "Jump",
    "Loop",
    "MoveBy",
    "MoveByCam",
    "MoveHome",
    "MoveTo",
    "Number",
    "Operand",
    "Outputs",
    "Parameter",
    "Password",
    "Power",
    "PreparedOutput",
    "PreparedSpeed",
    "Problem",
    "Program",
    "Record",
    "Repeat",
    "Return",
    "Severity",
    "Speed",
    "SpeedSync",
    "Status",
    "Value",
    "Variable",
    "Wait",
    "WaitDistance",
    "WaitPosition",
    "WaitStart",
    "check",
    "listing",
    "normalise",
    "parse",
    "parse_record",
    "raise_for_errors",
    "record_text",
    "wire_line",
    "wire_lines",
]

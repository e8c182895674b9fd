"""What each setting of a drive means in a few words, and how well its default is founded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = ["DIALECT_FACTS", "SETTING_FACTS", "SettingFact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingFact:
    """One setting, or one word of the dialect."""

    name: str
    meaning: str
    source: str = ""
    """Of what it is about; empty where no page at hand has anything on it."""
    certainty: Certainty | None = None
    """Of the default; None where it is a choice of this library and nothing that the drive determines."""


SETTING_FACTS: Final = (
    SettingFact(name="answer_timeout_s", meaning="how long an answer may take; the drive's own time is not documented"),
    SettingFact(name="resync_attempts", meaning="status queries to get back in step before the drive counts as silent"),
    SettingFact(name="reconnect", meaning="open a line that was lost, or that keeps silent, again"),
    SettingFact(name="reconnect_first_s", meaning="when a lost line is tried first, at most; later ever more rarely"),
    SettingFact(name="reconnect_slowest_s", meaning="longest pause between two attempts to get a lost line back"),
    SettingFact(name="reconnect_attempts", meaning="how often a lost line is tried; without it, until it is back"),
    SettingFact(name="unit", meaning="name of the unit chosen with P90, for people", source="UG p. 100"),
    SettingFact(
        name="decimals",
        meaning="of positions and distances: 2, or 3 for inches",
        source="UG p. 100-101",
        certainty=Certainty.DOCUMENTED,
    ),
    SettingFact(
        name="units",
        meaning="what each value of P90 means on this drive",
        source="UG p. 100-101",
        certainty=Certainty.UNKNOWN,
    ),
    SettingFact(name="travel", meaning="lowest and highest position that may be commanded", source="UG p. 100"),
    SettingFact(
        name="speed_limit_percent",
        meaning="speeds above are refused here; the drive takes up to 600",
        source="IBS p. 42",
    ),
    SettingFact(
        name="message_form",
        meaning="what the drive answers to a command with $; UNKNOWN lets the first move find out",
        source="UG p. 160, 162",
        certainty=Certainty.UNKNOWN,
    ),
    SettingFact(
        name="error_pattern",
        meaning="regular expression for an error in an answer; its one group is the code",
        source="UG p. 209",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="xonxoff_weight",
        meaning="what P20 holds when Xon and Xoff are heeded",
        source="UG p. 166, 485 p. 6",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="errors_suppressed_weight",
        meaning="what P20 holds when the drive keeps quiet about errors",
        source="UG p. 166",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="verify_messages",
        meaning="ask the status before $ is believed: for drives that send it after a stop or fault too",
        source="UG p. 160",
        certainty=Certainty.UNKNOWN,
    ),
    SettingFact(
        name="message_when_prepared",
        meaning="ask for $ when a move is prepared with a comma, too",
        source="UG p. 160",
        certainty=Certainty.UNKNOWN,
    ),
    SettingFact(
        name="binary_settings", meaning="send SPEED and ACCEL in binary where P20 allows it", source="UG p. 166"
    ),
    SettingFact(
        name="binary_motion",
        meaning="send POSA and POSR so, too: only on lines that cannot lose bytes",
        source="UG p. 166",
    ),
    SettingFact(name="poll_first_s", meaning="the status of a move is asked for the first time after this"),
    SettingFact(name="poll_slowest_s", meaning="and at least once in this time later on"),
    SettingFact(name="stall_timeout_s", meaning="a move whose axis stands still for so long has failed"),
    SettingFact(name="in_doubt_after_s", meaning="a move of which nothing is learnt for so long is in doubt"),
    SettingFact(name="stop_timeout_s", meaning="how long STOP is repeated until it is acknowledged"),
    SettingFact(
        name="standstill_timeout_s",
        meaning="how long an acknowledged STOP may take; its ramp is P10",
        source="CAN-S p. 28",
    ),
    SettingFact(name="dialect", meaning="words that may differ"),
)

DIALECT_FACTS: Final = (
    SettingFact(
        name="stop",
        meaning="stops program and positioning; START continues them",
        source="UG p. 101, CAN-S p. 28",
        certainty=Certainty.PLACEHOLDER,
    ),
    SettingFact(
        name="start",
        meaning="starts the program, or continues what was stopped",
        source="UG p. 101",
        certainty=Certainty.PLACEHOLDER,
    ),
    SettingFact(
        name="break_off",
        meaning="ends program and positioning; START does not continue them",
        source="CAN-S p. 28, CAN p. 32",
        certainty=Certainty.PLACEHOLDER,
    ),
    SettingFact(name="quit", meaning="acknowledges an error", source="CAN-S p. 28", certainty=Certainty.PLACEHOLDER),
    SettingFact(name="home", meaning="finds machine zero", source="UG p. 162", certainty=Certainty.DOCUMENTED),
    SettingFact(
        name="make_valid",
        meaning="declares parameters valid",
        source="UG p. 158-159, CAN p. 32",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="write_value",
        meaning="how a parameter or variable {name} is written, with {value}",
        source="IBS p. 23",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="record",
        meaning="how record {n} is written, with {text}",
        source="UG p. 95, IBS p. 54",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="set_pointer",
        meaning="lets START begin at record {n}",
        source="CAN p. 69, UG p. 158",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(name="single_record", meaning="runs record {n} alone", source="CAN p. 69", certainty=Certainty.UNKNOWN),
    SettingFact(
        name="real_zero",
        meaning="takes the actual position as real zero",
        source="CAN p. 32",
        certainty=Certainty.UNKNOWN,
    ),
    SettingFact(
        name="change_speed",
        meaning="another speed, {percent}, for the positioning that runs",
        source="IBS p. 42",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="power_on",
        meaning="drive energised, brake open",
        source="CAN p. 32, UG p. 162, 209",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="power_off",
        meaning="no current, brake closed",
        source="CAN p. 32, UG p. 162, 209",
        certainty=Certainty.INFERRED,
    ),
    SettingFact(
        name="power_off_brake_open",
        meaning="no current, brake open: a hanging load falls",
        source="CAN p. 32, UG p. 162, 209",
        certainty=Certainty.INFERRED,
    ),
)
"""A word whose certainty is UNKNOWN has no default: what needs it is refused until somebody gives one."""

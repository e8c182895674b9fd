"""What stands beside an answer is what its row says, and nothing where it is not understood."""

from __future__ import annotations

import pytest

from compax_aio import DriveSettings
from compax_aio.cli.shelling.decoding import answered
from compax_aio.cli.shelling.replies import Reply

MM = DriveSettings(unit="mm")


def told(reply: Reply) -> str:
    assert reply.people is not None
    return reply.people.plain


@pytest.mark.parametrize(
    ("line", "answer", "people"),
    [
        ("S1", "S001: 120.50", "S001: 120.50   actual position in mm"),
        ("S5", "S005: 3", "S005: 3   motor torque in % (inferred)"),
        ("s 016", "S016: 01010000", "S016: 01010000   no_warning, ready_for_start; no_fault is 0: a fault, or the "
                                    "self-test is not over"),
        ("S17", "S017: 00000000", "S017: 00000000   no bit is set"),
        ("S18", "S018: 00 00", "S018: 00 00   no errors"),
        ("S18", "S018: 99 55 53", "S018: 99 55 53   newest first:\n  E55: emergency stop; release the emergency stop, "
                                  "then quit() (p. 209); acknowledged\n  E53: overload of motor or unit; reduce load "
                                  "or duty, then quit() (p. 211); not acknowledged before the next"),
        ("S30", "S030: 55 0", "S030: 55 0   E55: emergency stop; release the emergency stop, then quit()"),
        ("S30", "S030: 0", "S030: 0   no error"),
        ("S200", "S200: abc", "S200: abc   unknown (unknown)"),
        ("P20", "P020: 19", "P020: 19   xonxoff, errors_suppressed, binary"),
        ("P20", "P020: 4", "P020: 4   nothing that is known is on; weights of unknown meaning: 4"),
        ("P3", "P003: 1.000", "P003: 1.000   no page at hand says what it is (unknown)"),
        ("V5", "V005: 2.5", "V005: 2.5"),
        ("N1", "N001: POSA 100", "N001: POSA 100"),
        ("S1", "S001: what", "S001: what   not understood: the answer holds no number that is understood"),
        ("P20", "P020: 1.5", "P020: 1.5   not understood: P20 is a whole number of bits (UG p. 166), not 1.5"),
        ("VERSION", "1\x1b[2J", "1\\x1b[2J"),
    ],
)  # fmt: skip
def test_the_meaning_stands_beside_the_raw_answer(line: str, answer: str, people: str) -> None:
    assert told(answered(line, answer, MM)) == people


def test_programs_get_values_and_bits_by_name() -> None:
    data = answered("S16", "S016: 11010000", MM).data
    assert data["answer"] == "S016: 11010000"
    assert data["bits"]["no_fault"] is True
    assert data["bits"]["position_reached"] is False
    assert answered("S1", "S001: 120.50", MM).data["value"] == 120.5
    assert answered("P20", "P020: 3", MM).data["xonxoff"] is True
    assert answered("N1", "N001: END", MM).data["record"] == "END"

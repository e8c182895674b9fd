"""Faults that are ordered in words say what they mean, or are refused with the right words."""

from __future__ import annotations

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.simulator.planned_faults import FAULT_KINDS, duration_s, kind_named, read_fault, read_faults


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("garbled=0.01", ("garbled", 0.01, 0.0, 0.0, None)),
        ("late=0.05:300ms", ("late", 0.05, 0.3, 0.0, None)),
        ("late", ("late", None, 0.5, 0.0, None)),
        ("split:2ms@1s+2s", ("split", None, 0.002, 1.0, 2.0)),
        ("silent@10s+5s", ("silent", None, 1.0, 10.0, 5.0)),
        ("Unplug=1:2@0.5min+60s", ("unplug", 1.0, 2.0, 30.0, 60.0)),
        ("E55@12s", ("E55", None, 0.0, 12.0, None)),
        ("e7=0.5", ("E7", 0.5, 0.0, 0.0, None)),
        (" cut@0 ", ("cut", None, 0.0, 0.0, None)),
    ],
)
def test_a_fault_is_read_as_it_is_written(
    text: str, says: tuple[str, float | None, float, float, float | None]
) -> None:
    fault = read_fault(text)
    assert (fault.kind.name, fault.chance, fault.amount_s, fault.start_s, fault.span_s) == says
    assert fault.text == text.strip()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is no fault"),
        ("garbled 0.01", "is no fault"),
        ("noisy=0.1", "there are garbled, lost"),
        ("E98@1s", "no fault 'E98'"),
        ("E0@1s", "no fault 'E0'"),
        ("garbled=2", "is no chance"),
        ("garbled=nan", "is no chance"),
        ("garbled=often", "is no chance"),
        ("garbled=0.1:3s", "takes no time of its own"),
        ("silent:3s", r"silent@10s\+3s"),
        ("silent@soon", "is no time"),
        ("silent@1s+-2s", "is no time"),
        ("silent@9999999s", "is no time"),
        ("cut", "say when, or how often"),
        ("cut@1s+2s", "happens once"),
        ("E55", "say when, or how often"),
    ],
)
def test_what_is_no_fault_is_refused(text: str, says: str) -> None:
    with pytest.raises(InvalidCommandError, match=says):
        read_fault(text)


def test_all_that_are_listed_can_be_ordered_by_chance() -> None:
    faults = read_faults(f"{kind.name}=0.5" for kind in FAULT_KINDS)
    assert [fault.kind for fault in faults] == list(FAULT_KINDS)


def test_a_device_has_faults_by_their_code() -> None:
    assert kind_named("E55").code == 55
    assert kind_named("e3").chance_is_per == "command"
    assert kind_named("lost").chance_is_per == "byte"


def test_times_have_units() -> None:
    assert [duration_s(each) for each in ("5", "5s", "250ms", "2min", "0.5")] == [5.0, 5.0, 0.25, 120.0, 0.5]

"""What one look at the drive says about a pending move."""

from __future__ import annotations

import itertools

import pytest

from compax_aio.compax.codecs import DriveStatus
from compax_aio.compax.facts.status import S16_BITS, S17_BITS
from compax_aio.compax.verdict import Verdict, judge


def status(*names: str, fault: bool = False) -> DriveStatus:
    """A status in which the bits *names* are set, and no fault."""
    wanted = {*names} if fault else {*names, "no_fault"}
    assert wanted <= {bit.name for bit in (*S16_BITS, *S17_BITS)}
    digits = ["".join("01"[bit.name in wanted] for bit in bits) for bits in (S16_BITS, S17_BITS)]
    return DriveStatus.decode(f"S016: {digits[0]}", f"S017: {digits[1]}")


STOPS = [("idle_after_stop",), ("stopped_by_input",), ("idle_after_stop", "stopped_by_input")]


@pytest.mark.parametrize(("is_at_target", "finds_machine_zero"), list(itertools.product([True, False], repeat=2)))
def test_a_fault_comes_before_everything_else(is_at_target: bool, finds_machine_zero: bool) -> None:
    seen = status("command_active", "position_reached", "machine_zero_approached", "idle_after_stop", fault=True)
    assert judge(seen, is_at_target=is_at_target, finds_machine_zero=finds_machine_zero) is Verdict.FAULT


@pytest.mark.parametrize(("is_at_target", "finds_machine_zero"), list(itertools.product([True, False], repeat=2)))
def test_a_move_whose_command_is_active_is_moving_whatever_else_is_said(
    is_at_target: bool, finds_machine_zero: bool
) -> None:
    seen = status("command_active", "position_reached", "machine_zero_approached", "idle_after_stop")
    assert judge(seen, is_at_target=is_at_target, finds_machine_zero=finds_machine_zero) is Verdict.MOVING


def test_a_move_has_ended_when_bit_and_position_agree() -> None:
    reached = status("position_reached")
    assert judge(reached, is_at_target=True, finds_machine_zero=False) is Verdict.REACHED
    assert judge(reached, is_at_target=False, finds_machine_zero=False) is Verdict.UNCLEAR
    assert judge(status(), is_at_target=True, finds_machine_zero=False) is Verdict.UNCLEAR


def test_a_position_reached_of_an_earlier_move_is_not_that_of_this_one() -> None:
    """The command was lost on a drive that keeps quiet about errors; the drive stands where it stood."""
    assert judge(status("position_reached"), is_at_target=False, finds_machine_zero=False) is not Verdict.REACHED


@pytest.mark.parametrize("bits", STOPS)
def test_a_drive_that_stands_after_a_stop_elsewhere_was_stopped(bits: tuple[str, ...]) -> None:
    for seen in (status(*bits), status(*bits, "position_reached")):
        assert judge(seen, is_at_target=False, finds_machine_zero=False) is Verdict.STOPPED


def test_machine_zero_is_found_when_its_bit_says_so() -> None:
    assert judge(status("machine_zero_approached"), is_at_target=False, finds_machine_zero=True) is Verdict.REACHED
    assert judge(status("position_reached"), is_at_target=True, finds_machine_zero=True) is Verdict.UNCLEAR


def test_a_search_that_was_stopped_has_found_nothing_though_the_bit_is_from_before() -> None:
    seen = status("machine_zero_approached", "idle_after_stop")
    assert judge(seen, is_at_target=False, finds_machine_zero=True) is Verdict.STOPPED

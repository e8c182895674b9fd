"""An instruction is exchanged only if no other is harmed by it."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hostile.wicked import refusal

from compax_aio.smc.codecs import Listed
from compax_aio.smc.facts import INSTRUCTION_BYTES
from compax_aio.smc.profile import DCB_274
from compax_aio.smc.program_layout import check_jumps, learn_lengths, nv_length, plan_exchange
from compax_aio.smc.program_text import check_program

LISTING = check_program(["O0", "R10000", "W0", "R-10000", "W0", "J1,3", "R500"], DCB_274)
"""DCB p. 24: 0 O0, 1 R10000, 6 W0, 9 R-10000, 14 W0, 17 J1 3, 21 R500, 26."""


def laid(*instructions: str, start: int = 0) -> tuple[Listed, ...]:
    return check_program(instructions, DCB_274, start=start)


# Lengths --------------------------------------------------------------------------------------------------------------


def test_lengths_are_the_manuals() -> None:
    texts = ("O0", "W0", "J1 3", "R-10000", "V500", "")
    assert [nv_length(text) for text in texts] == [1, 3, 4, 5, None, None]


def test_a_listing_confirms_what_is_known() -> None:
    assert learn_lengths(LISTING) == INSTRUCTION_BYTES
    assert learn_lengths([]) == INSTRUCTION_BYTES


def test_a_listing_teaches_what_was_not_known() -> None:
    listing = [Listed(0, "V500"), Listed(3, "R1"), Listed(8, "V600"), Listed(11, "M0"), Listed(16, "")]
    assert learn_lengths(listing) == {**INSTRUCTION_BYTES, "V": 3, "M": 5}


def test_a_listing_that_contradicts_itself_teaches_nothing() -> None:
    listing = [Listed(0, "V500"), Listed(3, "V600"), Listed(8, "R1"), Listed(13, "")]
    assert learn_lengths(listing) == INSTRUCTION_BYTES


def test_a_listing_that_contradicts_the_manual_leaves_nothing_known() -> None:
    assert "R" not in learn_lengths([Listed(0, "R1"), Listed(6, "R2"), Listed(12, "")])


def test_a_gap_between_programs_teaches_nothing() -> None:
    listing = [Listed(0, "R1"), Listed(5, "R2"), Listed(12, "V500"), Listed(100, "O0"), Listed(101, "")]
    assert learn_lengths(listing) == INSTRUCTION_BYTES
    assert learn_lengths([Listed(0, "V500"), Listed(None, "R1")]) == INSTRUCTION_BYTES
    assert learn_lengths([Listed(0, "V500"), Listed(13, "R1")]) == INSTRUCTION_BYTES
    assert learn_lengths([Listed(0, "V500"), Listed(12, "R1")])["V"] == 12


# Jumps ----------------------------------------------------------------------------------------------------------------


def test_jumps_are_looked_at_by_where_they_lead() -> None:
    assert list(check_jumps(LISTING)) == []
    wrong = [Listed(0, "J4 1"), Listed(4, "J8 1"), Listed(8, "")]
    assert list(check_jumps(wrong)) == [(1, "no instruction begins at 8")]
    assert list(check_jumps([Listed(0, "J"), Listed(4, "J\u0661 2")])) == [], "what is no jump leads nowhere"


# Exchanges ------------------------------------------------------------------------------------------------------------


def test_an_instruction_of_the_same_length_is_exchanged_in_its_place() -> None:
    plan = plan_exchange(LISTING, 21, "R600")
    assert (plan.address, plan.instructions, plan.is_in_place) == (21, ("R600",), True)
    assert plan.expected == (*LISTING[:6], Listed(21, "R600"))
    assert (plan.moved, plan.left_over_bytes) == ({}, 0)


def test_a_longer_instruction_takes_all_behind_it_along() -> None:
    plan = plan_exchange(LISTING, 14, "R7")
    assert (plan.address, plan.instructions, plan.is_in_place) == (14, ("R7", "J1 3", "R500"), False)
    assert plan.expected == (*LISTING[:4], Listed(14, "R7"), Listed(19, "J1 3"), Listed(23, "R500"))
    assert (plan.moved, plan.left_over_bytes) == ({17: 19, 21: 23}, 0)


def test_a_shorter_instruction_leaves_bytes_behind_the_end() -> None:
    plan = plan_exchange(LISTING, 14, "O0")
    assert plan.instructions == ("O0", "J1 3", "R500")
    assert (plan.moved, plan.left_over_bytes) == ({17: 15, 21: 19}, 2)


def test_the_last_instruction_has_none_behind_it() -> None:
    plan = plan_exchange(LISTING, 21, "W0")
    assert (plan.address, plan.instructions, plan.moved, plan.left_over_bytes) == (21, ("W0",), {}, 2)
    assert not plan.is_in_place
    assert plan_exchange(LISTING[:-1], 21, "W0") == plan, "the place behind it need not be shown"


def test_a_jump_follows_its_instruction() -> None:
    plan = plan_exchange(LISTING, 0, "R5")
    assert plan.instructions == ("R5", "R10000", "W0", "R-10000", "W0", "J5 3", "R500")


def test_a_jump_to_the_exchanged_instruction_stays_as_it_is() -> None:
    plan = plan_exchange(laid("J9 2", "R1", "W0", "R2", "J4 5"), 9, "R3")
    assert (plan.address, plan.instructions) == (9, ("R3", "R2", "J4 5"))


def test_a_jump_from_before_is_entered_anew_with_all_behind_it() -> None:
    plan = plan_exchange(laid("O0", "J13 2", "R1", "W0", "R2"), 10, "R3")
    assert (plan.address, plan.instructions) == (1, ("J15 2", "R1", "R3", "R2"))
    assert plan.expected == laid("O0", "J15 2", "R1", "R3", "R2")[:-1]


def test_a_new_jump_is_meant_by_the_listing_as_it_is() -> None:
    plan = plan_exchange(LISTING, 14, "J21 2")
    assert plan.instructions == ("J22 2", "J1 3", "R500")
    assert plan_exchange(LISTING, 14, "J14 2").instructions[0] == "J14 2"
    assert plan_exchange(LISTING, 17, "J21 2").instructions == ("J21 2",), "nothing moves"


def test_a_jump_into_nowhere_may_be_exchanged_but_nothing_may_be_moved_past_it() -> None:
    broken = (Listed(0, "O0"), Listed(1, "J7 1"), Listed(5, "W0"), Listed(8, ""))
    assert plan_exchange(broken, 1, "J5 1").is_in_place
    assert plan_exchange(broken, 1, "W0").instructions == ("W0", "W0")
    assert plan_exchange(broken, 5, "W9").is_in_place
    assert refusal(lambda: plan_exchange(broken, 0, "W0")) == "no instruction begins at 7, where 'J7 1' leads"
    assert refusal(lambda: plan_exchange(broken, 1, "J7 2")) == "no instruction begins at 7, where 'J7 2' leads"


@pytest.mark.parametrize(
    ("address", "text", "said"),
    [
        (2, "R1", "no instruction begins at 2; they begin at 0, 1, 6, 9, 14, 17, 21"),
        (26, "R1", "no instruction begins at 26; they begin at 0, 1, 6, 9, 14, 17, 21"),
        (
            21,
            "V500",
            "how many bytes 'V' takes is not known, or not beyond doubt; enter the whole program anew, or a program "
            "with such an instruction where nothing can be harmed: its listing shows the length",
        ),
    ],
)
def test_an_exchange_that_might_harm_others_is_refused(address: int, text: str, said: str) -> None:
    assert refusal(lambda: plan_exchange(LISTING, address, text)) == said


def test_an_empty_program_has_nothing_to_exchange() -> None:
    for empty in ((), (Listed(0, ""),)):
        assert refusal(lambda empty=empty: plan_exchange(empty, 0, "R1")) == (  # type: ignore[misc]
            "no instruction begins at 0; the program is empty"
        )


def test_a_program_of_unknown_addresses_is_listed_first() -> None:
    assert refusal(lambda: plan_exchange((Listed(0, "V500"), Listed(None, "R1")), 0, "V600")) == (
        "where 'R1' begins is not known; list the program first"
    )


def test_an_instruction_of_unknown_length_is_no_obstacle_before_the_exchange() -> None:
    program = (Listed(0, "V500"), Listed(20, "W0"), Listed(23, "O0"), Listed(24, ""))
    assert plan_exchange(program, 20, "R1").instructions == ("R1", "O0")
    assert refusal(lambda: plan_exchange(program, 0, "V600")), "there may be anything between 0 and 20"
    behind = (Listed(0, "W0"), Listed(3, "V500"))
    assert plan_exchange(behind, 0, "W1").is_in_place
    assert refusal(lambda: plan_exchange(behind, 0, "O0"))
    assert plan_exchange(behind, 0, "O0", {"W": 3, "O": 1, "V": 3}).instructions == ("O0", "V500")


GAP = (Listed(0, "W0"), Listed(3, "W0"), Listed(10, "W0"), Listed(13, ""))


@pytest.mark.parametrize(("address", "text"), [(3, "W5"), (3, "R1"), (0, "R1")])
def test_a_gap_is_not_written_over(address: int, text: str) -> None:
    assert refusal(lambda: plan_exchange(GAP, address, text)) == (
        "'W0' at 3 takes 3 bytes, and the next place is 10: the listing has a gap, or is damaged; "
        "enter the whole program anew"
    )


def test_around_a_gap_all_is_as_ever() -> None:
    assert plan_exchange(GAP, 0, "W5").is_in_place
    assert plan_exchange(GAP, 10, "R1").instructions == ("R1",)
    assert refusal(lambda: plan_exchange((*GAP[:3], Listed(99, "")), 10, "R1"))


def test_a_gap_is_not_written_over_for_the_sake_of_a_jump_before_it_either() -> None:
    program = (Listed(0, "J13 1"), Listed(4, "O0"), Listed(10, "W0"), Listed(13, "O0"), Listed(14, ""))
    assert plan_exchange(program, 10, "W1").is_in_place
    assert "'O0' at 4 takes 1 byte," in str(refusal(lambda: plan_exchange(program, 10, "R1")))


# Whatever the program -------------------------------------------------------------------------------------------------


def entered(before: tuple[Listed, ...], address: int, instructions: tuple[str, ...]) -> list[tuple[int, str]]:
    """What an axis has after program entry: its memory as bytes, instructions one behind the other."""
    kept = [(each.address or 0, each.text) for each in before if each.text and (each.address or 0) < address]
    for text in instructions:
        kept.append((address, text))
        address += INSTRUCTION_BYTES[text[0]]
    untouched = [(each.address or 0, each.text) for each in before if each.text and (each.address or 0) >= address]
    return kept + (untouched if len(instructions) == 1 else [])


def path_of(program: Mapping[int, str]) -> list[tuple[str, int | None]]:
    """Each instruction, and of a jump the place in the order to which it leads."""
    order = sorted(program)
    return [
        (program[at][0], order.index(int(program[at][1:].split()[0])) if program[at][0] == "J" else None)
        for at in order
    ]


@given(st.data())
def test_after_an_exchange_every_jump_leads_where_it_led(data: st.DataObject) -> None:
    kinds = data.draw(st.lists(st.sampled_from("OWRJ"), min_size=1, max_size=8))
    places = [sum(INSTRUCTION_BYTES[kind] for kind in kinds[:at]) for at in range(len(kinds) + 1)]
    texts = [f"J{data.draw(st.sampled_from(places[:-1]))} 1" if kind == "J" else f"{kind}0" for kind in kinds]
    program = check_program(texts, DCB_274)
    at = data.draw(st.integers(0, len(kinds) - 1))
    new = data.draw(st.sampled_from(["O0", "W1", "R1", f"J{data.draw(st.sampled_from(places[:-1]))} 2"]))
    plan = plan_exchange(program, places[at], new)
    after = entered(program, plan.address, plan.instructions)
    assert [Listed(*each) for each in after] == list(plan.expected)
    wanted = {place: new if place == places[at] else text for place, text in zip(places, texts, strict=False)}
    assert path_of(dict(after)) == path_of(wanted)
    assert not list(check_jumps(plan.expected))

"""Programs are bytes in non-volatile memory: entered, listed, edited with harm, and run to their end."""

from __future__ import annotations

import pytest
from tests.simulator.smc.host import Host

from compax_aio.simulator.smc import Knobs, LogKind
from compax_aio.simulator.smc.language import Instruction, parsed
from compax_aio.simulator.smc.memory import Memory
from compax_aio.smc.facts import MAX_POSITION

EXAMPLE = ("O0", "R10000", "W0", "R-10000", "W0", "J1 3", "R500")
ADDRESSES = (0, 1, 6, 9, 14, 17, 21, 26)
LISTING = ["0 O 0", "1 R 10000.00", "6 W 0", "9 R -10000.00", "14 W 0", "17 J 1 3", "21 R 500.00"]


def entered(host: Host, *instructions: str, address: int = 0) -> Host:
    for text in (f"P{address}", *instructions, "P0"):
        assert host.command("A", text) == ""
    return host


def ends(host: Host) -> list[str]:
    return [each for each in host.motions() if each.startswith("target")]


def test_the_worked_example_has_the_addresses_that_are_printed() -> None:
    host = entered(Host(), *EXAMPLE)
    assert host.axis.listing == LISTING
    assert host.command("A", "Q").split("\n") == ["", *LISTING]
    assert host.command("A", "Q 9").split("\n") == ["", *LISTING[3:]]
    assert len(host.axis.program) == ADDRESSES[-1]
    assert host.texts(LogKind.WRITTEN) == [
        f"{address}: {text}" for address, text in zip(ADDRESSES, EXAMPLE, strict=False)
    ]
    assert host.axis.memory_writes == 7
    assert host.texts(LogKind.COMMAND)[0] == "P0"


def test_the_worked_example_runs_to_its_end() -> None:
    host = entered(Host(position=77), *EXAMPLE)
    host.command("A", "G0 1", 200)
    assert host.axis.position == 500
    assert ends(host) == [*(4 * ["target at 10000", "target at -10000"]), "target at 500"]
    assert host.texts(LogKind.PROGRAM) == ["started 0", "ended 26"]
    assert not host.axis.program_runs
    host.command("A", "G", 200)  # the counts of jumps begin anew
    assert len(ends(host)) == 18


def test_a_program_may_begin_anywhere() -> None:
    host = entered(Host(), *EXAMPLE)
    host.command("A", "G21", 5)
    assert host.axis.position == 500
    assert host.texts(LogKind.PROGRAM) == ["started 21", "ended 26"]


def test_while_a_program_runs_every_command_waits_for_its_end() -> None:
    host = entered(Host(), "R1000", "W0", "R0", "W0")
    host.command("A", "G")
    host.type(b"\n", 0.01)
    assert host.echoed(b"A^") == b"A^"
    assert host.send(b"\n", 0.1) == b""
    assert host.texts(LogKind.QUEUED) == ["^"]
    assert host.wait(10) == b"         0\n"


def test_while_a_program_runs_an_axis_can_be_deaf() -> None:
    host = entered(Host(during_program="deaf", axes="AB"), "R1000", "W0")
    host.command("A", "G")
    assert host.type(b"\nA^\n", 0.01) == b""
    assert host.command("B", "^") == "         0"
    host.wait(10)
    assert host.command("A", "^") == "         0"


def test_an_action_while_a_program_runs_can_be_refused() -> None:
    host = entered(Host(second_action="reject", unknown="?"), "R1000", "W0")
    host.command("A", "G")
    assert host.command("A", "R5") == "?"


def test_an_action_waits_for_the_end_of_a_program_that_moves_nothing() -> None:
    host = entered(Host(), "W100", "A8")
    host.command("A", "G")
    host.type(b"\nAR5\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["R5"]
    host.wait(3)
    assert (host.axis.outputs, host.axis.position) == (8, 5)


def test_the_counts_of_jumps_begin_anew_with_the_program() -> None:
    host = entered(Host(), "+1000", "W0", "J0 3")
    host.command("A", "G", 1.0)
    host.send(b"\x1b")
    done = host.axis.position
    assert 1000 < done < 4000
    host.command("A", "G", 10)
    assert host.axis.position == done + 4000


def test_esc_aborts_a_program() -> None:
    host = entered(Host(), *EXAMPLE)
    host.command("A", "G", 1)
    host.send(b"\x1b", 100)
    assert host.motions()[-1].startswith("abort")
    assert host.texts(LogKind.PROGRAM)[-1].startswith("aborted ")
    assert not host.axis.program_runs
    assert host.command("A", "^") == "         0"


def test_an_action_in_a_program_waits_for_the_one_before() -> None:
    host = entered(Host(), "R1000", "R0", "M500", "W200", "M0")
    host.command("A", "G", 30)
    assert [each.split()[0] for each in host.motions()] == ["R", "target", "R", "target", "M", "M", "target"]
    assert 990 < host.axis.position < 1100


def test_waits_and_instructions_take_their_time() -> None:
    host = entered(Host(wait_unit_s=0.1, instruction_time_s=0.5), "W30", "A8")
    host.command("A", "G", 0.01)
    host.wait(3.9)
    assert host.axis.outputs == 0
    host.wait(0.2)
    assert host.axis.outputs == 8
    assert host.axis.program_runs
    host.wait(0.5)
    assert not host.axis.program_runs


def test_g_in_a_program_goes_there_and_esc_is_the_way_out_of_a_loop() -> None:
    host = entered(Host(), "+1", "G0")
    host.command("A", "G", 10)
    assert host.axis.position > 100
    assert host.axis.program_runs
    host.send(b"\x1b")
    assert not host.axis.program_runs


def test_w0_in_a_program_waits_for_ever_at_constant_speed() -> None:
    host = entered(Host(), "M1000", "W0", "A8")
    host.command("A", "G", 1000)
    assert host.axis.program_runs
    assert host.axis.outputs == 0


# Entry


def test_each_line_is_stored_at_once_even_if_power_fails_before_the_end() -> None:
    host = Host()
    host.command("A", "P0")
    host.command("A", "R5")
    host.line.power_cycle(host.now)
    host.wait(1)
    assert host.axis.listing == ["0 R 5.00"]
    host.command("A", "R7", 5)
    assert host.axis.position == 7
    assert host.axis.listing == ["0 R 5.00"]


@pytest.mark.parametrize("end", [b"\x1b", b"\nAP0\n"])
def test_esc_and_p0_end_the_entry(end: bytes) -> None:
    host = Host()
    host.command("A", "P3")
    host.command("A", "R5", 5)
    assert host.axis.position == 0
    host.type(end)
    host.command("A", "R7", 5)
    assert host.axis.position == 7
    assert host.axis.program[:4] == b"\xff\xff\xffR"


def test_an_address_during_entry_moves_it() -> None:
    host = Host()
    for text in ("P9", "A8", "P20", "A16", "P0"):
        host.command("A", text)
    assert host.texts(LogKind.WRITTEN) == ["9: A8", "20: A16"]


def test_what_cannot_stand_in_a_program_is_refused_during_entry() -> None:
    host = Host(unknown="?")
    host.command("A", "P0")
    for text in ("^", "Z", "S", "N1"):
        assert host.command("A", text) == "?"
    assert host.axis.program == b""
    assert host.axis.memory_writes == 0


def test_a_full_memory_takes_no_more() -> None:
    host = Host(program_size=16, unknown="?")
    host.command("A", "P9")
    assert host.command("A", "R1") == ""
    assert host.command("A", "R1") == "?"
    assert host.command("A", "W1") == "?"
    assert host.command("A", "O") == ""
    assert host.command("A", "P16") == ""
    assert host.axis.listing == []
    host.command("A", "P0")
    host.command("A", "P5000")
    assert host.command("A", "O") == "?"


# Edits


def test_an_edit_of_the_same_length_changes_one_instruction() -> None:
    host = entered(Host(), *EXAMPLE)
    host.command("A", "P21")
    host.command("A", "R700")
    host.send(b"\x1b")
    assert host.axis.listing == [*LISTING[:-1], "21 R 700.00"]


def test_a_longer_instruction_overwrites_what_follows() -> None:
    host = entered(Host(), *EXAMPLE)
    host.command("A", "P6")
    host.command("A", "R7")
    host.send(b"\x1b")
    assert host.axis.listing[:3] == ["0 O 0", "1 R 10000.00", "6 R 7.00"]
    assert host.axis.listing[3] == "11 ?"  # the middle of what was R -10000
    assert "9 R -10000.00" not in host.axis.listing


def test_a_shorter_instruction_leaves_the_rest_of_the_old_one() -> None:
    host = entered(Host(), "R10000", "R21", "A8")
    host.command("A", "P0")
    host.command("A", "W9")
    host.send(b"\x1b")
    # A byte of what was R10000 is @, and takes the beginning of R21 with it.
    assert host.axis.listing == ["0 W 9", "3 ?", "4 @", "9 ?", "10 A 8"]
    host.command("A", "G", 5)
    assert (host.axis.position, host.axis.outputs) == (0, 8)


def test_misread_numbers_never_lead_beyond_what_an_axis_can_do() -> None:
    host = entered(Host(), "R1", "V1")
    host.axis._machine.memory.program[:10] = b"R\x7f\xff\xff\xffV\x7f\xff\xff\xff"
    host.command("A", "G", 1)
    assert host.axis.parameters.slew_speed == 20_000
    host.wait(10_000)
    assert host.axis.position == int(MAX_POSITION)


# Bytes


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("O0", 1), ("W65535", 3), ("J513 7", 4), ("R-8388607.99", 5), ("+8388607.99", 5), ("-0.01", 5), ("M-20000", 5),
        ("F20000 1", 5), ("G5 1", 5), ("@", 5), ("V20000", 5), ("K255 0", 5), ("Y100 5", 5), ("A8", 5), ("l1", 5),
    ],
)  # fmt: skip
def test_an_instruction_reads_as_it_was_written(text: str, length: int) -> None:
    memory = Memory(Knobs(), "A")
    what = parsed(text)
    assert what is not None
    assert memory.write(40, what) == 40 + length
    assert memory.read(40) == (what, 40 + length)
    assert memory.read(40 + length) is None


def test_lengths_are_a_knob_and_what_does_not_fit_is_cut_off() -> None:
    memory = Memory(Knobs(instruction_bytes="V3 O5 R3"), "A")
    assert memory.write(0, Instruction("V", (70_000.0,))) == 3
    assert memory.read(0) == (Instruction("V", (70_000.0 % 65_536,)), 3)
    assert memory.write(3, Instruction("O", (-5.0,))) == 8
    assert memory.read(3) == (Instruction("O", (-5.0,)), 8)
    assert memory.write(8, Instruction("R", (-1.5,))) == 11
    assert memory.read(8) == (Instruction("R", (-1.5,)), 11)


def test_an_instruction_at_the_very_end_reads_what_is_not_there_as_erased() -> None:
    memory = Memory(Knobs(program_size=16), "A")
    memory.program[14:] = b"W\x00"
    assert memory.read(14) == (Instruction("W", (255.0,)), 17)
    assert memory.read(17) is None
    assert memory.listing(14) == ["14 W 255"]

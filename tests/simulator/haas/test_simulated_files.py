"""Programs and numbered data in a simulated control: what is stored, what is sent, and which alarms there are."""

from __future__ import annotations

import pytest
from tests.simulator.haas.host import Host

from compax_aio.simulator.haas import LogKind

# Programs


def test_a_program_is_stored_under_its_name() -> None:
    host = Host()
    assert host.load(b"\r\n%\r\nO00077(PART 7)\r\nN10 G90 G54\r\n\r\nX1.\r\nM30\r\n\r\n%\r\n") == "RS232 DONE"
    assert host.control.memory.programs["O00077"] == "O00077(PART 7)\nN10 G90 G54\n\nX1.\nM30"
    assert host.texts(LogKind.STORED) == ["O00077"]
    assert not host.control.alarms


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r"])
def test_any_end_of_block_is_taken(end: bytes) -> None:
    host = Host()
    host.load(end.join([b"%", b"O00077", b"G0 X1.", b"M30", b"%", b""]))
    assert host.control.memory.programs["O00077"] == "O00077\nG0 X1.\nM30"


@pytest.mark.parametrize(("eob", "end"), [("cr cr", b"\r\r"), ("lf lf", b"\n\n")])
def test_two_characters_are_one_end_where_the_setting_says_so(eob: str, end: bytes) -> None:
    host = Host(eob=eob)
    host.load(end.join([b"%", b"O00077", b"G0 X1.", b"M30", b"%", b""]))
    assert host.control.memory.programs["O00077"] == "O00077\nG0 X1.\nM30"
    assert host.fetch("O00077").replace(end, b"|") == b"|%|O00077|G0 X1.|M30||%|"
    plain = Host()
    plain.load(end.join([b"%", b"O00077", b"M30", b"%", b""]))
    assert plain.control.memory.programs["O00077"] == "O00077\n\nM30"


def test_what_is_sent_and_received_again_stays_the_same() -> None:
    host = Host()
    first = host.fetch("O01234")
    host.load(first)
    assert host.fetch("O01234") == first


@pytest.mark.parametrize(
    ("add_spaces", "sent"),
    [("on", b"N10 G90 G01 X1.5 Y-2. (DEEP CUT) F20."), ("off", b"N10G90G01X1.5Y-2.(DEEP CUT)F20.")],
)
def test_setting_41_puts_spaces_between_words(add_spaces: str, sent: bytes) -> None:
    host = Host(add_spaces=add_spaces)
    host.load(b"%\nO00001\nN10G90 G01X1.5Y-2.(DEEP CUT)F20.\n#1=#2+1\n%\n")
    assert host.fetch("O00001") == b"\r\n%\r\nO00001\r\n" + sent + b"\r\n#1=#2+1\r\n\r\n%\r\n"


def test_a_setting_that_is_loaded_takes_effect_if_it_is_on_or_off() -> None:
    host = Host()
    assert host.send(b"Q100\r\n")
    host.load(b"%\nN41 V0\nN143 V0\nN187 V1\n%\n", "settings")
    assert b"G90G54G00X0.Y0." in host.fetch("O01234")
    assert host.send(b"Q100\r\n") == b""
    assert host.control.lost_bytes == 4
    host.load(b"%\nN143 V1\n%\n", "settings")
    assert host.send(b"Q201\r\n") == b"Q201\r\n\x02USING TOOL, 4\x17\r\n>"


def test_all_programs_go_within_one_pair_of_percent_signs_or_each_within_its_own() -> None:
    one = Host().fetch("ALL")
    assert one.count(b"%") == 2
    assert [one.count(name) for name in (b"O00010", b"O01234", b"O09810")] == [1, 1, 1]
    assert Host(all_in="pairs").fetch("ALL").count(b"%") == 6


@pytest.mark.parametrize("form", ["one pair", "pairs"])
def test_several_programs_are_taken_in_either_form(form: str) -> None:
    host = Host(end_of_receive="silence" if form == "pairs" else "percent")
    between = b"\n%\n%\n" if form == "pairs" else b"\n"
    host.receive()
    host.send(b"%\nO00001\nM30" + between + b"O00002\nM99\n%\n")
    if form == "pairs":
        assert host.control.screen == ""
        host.wait(1.1)
    assert host.control.screen == "RS232 DONE"
    assert host.control.memory.programs["O00001"] == "O00001\nM30"
    assert host.control.memory.programs["O00002"] == "O00002\nM99"


@pytest.mark.parametrize(
    ("leader", "first"), [("none", b"\r"), ("blank", b" " * 60 + b"\r"), ("nul", bytes(60) + b"\r")]
)
def test_setting_24_sends_a_leader(leader: str, first: bytes) -> None:
    sent = Host(leader=leader).fetch("O00010")
    assert sent.startswith(first)
    host = Host()
    assert host.load(sent) == "RS232 DONE"
    assert not host.control.alarms


def test_a_control_of_the_1990s_has_four_digits() -> None:
    host = Host(o_digits=4)
    assert b"\r\nO1234\r\n" in host.fetch("O1234")
    assert host.load(b"%\nO00077\nM30\n%\n") == "RS232 ABORT"
    assert host.alarms() == ["illegal-program-name"]
    assert host.load(b"%\nO0077\nM30\n%\n") == "RS232 DONE"


def test_lead_in_and_the_empty_block_before_the_end_can_be_left_out() -> None:
    host = Host(lead_in=False, blank_before_end=False)
    host.load(b"%\nO00001\nM30\n%\n")
    assert host.fetch("O00001") == b"%\r\nO00001\r\nM30\r\n%\r\n"


def test_there_is_no_such_program() -> None:
    host = Host()
    with pytest.raises(ValueError, match="there are O00010, O01234, O09810"):
        host.control.press_send("O00011")
    with pytest.raises(ValueError, match="anything"):
        host.control.press_send("anything")
    with pytest.raises(ValueError, match="anything"):
        host.control.press_recv("anything")
    assert host.control.doing == "nothing"


@pytest.mark.parametrize(
    ("block", "alarm", "stored"),
    [
        (b"G0 X1.\x07", "invalid-code", "(G0 X1.?)"),
        (b"g0 x1", "invalid-code", "(g0 x1)"),
        (b"HELLO (WORLD", "missing-code", "(HELLO WORLD)"),
        (b"G0 X", "missing-code", "(G0 X)"),
        (b"X12345678901", "number-range", "(X12345678901)"),
    ],
)
def test_a_garbled_block_becomes_a_comment_with_an_alarm(block: bytes, alarm: str, stored: str) -> None:
    host = Host(data_bits=8)
    assert host.load(b"%\nO00001\n" + block + b"\nM30\n%\n") == "RS232 DONE"
    assert host.control.memory.programs["O00001"] == f"O00001\n{stored}\nM30"
    assert host.alarms() == [alarm]
    lax = Host(data_bits=8, garbled_as_comment=False)
    lax.load(b"%\nO00001\n" + block + b"\nM30\n%\n")
    assert lax.control.memory.programs["O00001"].split("\n")[1].encode("latin-1") == block.strip()
    assert not lax.control.alarms


@pytest.mark.parametrize(
    "block",
    [
        "/G0 X1. Y-.5",
        "/2 N10 G1 Z-0.125 F#101",
        "#100=#101+[SIN[30.]*2]",
        "IF [#1 EQ 2] GOTO 10",
        "WHILE [#1 LT 5] DO1",
        "END1",
        "DPRNT[X#5021[44]*TOOL*4]",
        "POPEN",
        "G65 P9832 X[#1+2.] (comments may be in small letters: yes!)",
        "N5 G1 X#1 Y-#2",
        "T1 M6",
    ],
)
def test_blocks_of_all_kinds_are_stored_as_they_are(block: str) -> None:
    host = Host()
    host.load(f"%\nO00001\n{block}\n%\n".encode())
    assert not host.alarms()
    assert host.control.memory.programs["O00001"] == f"O00001\n{block}"


@pytest.mark.parametrize(
    ("data", "alarm"),
    [
        (b"%\nG0 X1\n%\n", "no-program-name"),
        (b"%\nOABC\nM30\n%\n", "illegal-program-name"),
        (b"%\nO123456\nM30\n%\n", "illegal-program-name"),
        (b"%\nO00000\nM30\n%\n", "illegal-program-name"),
    ],
)
def test_a_program_without_a_good_name_is_not_stored(data: bytes, alarm: str) -> None:
    host = Host()
    before = dict(host.control.memory.programs)
    assert host.load(data) == "RS232 ABORT"
    assert host.alarms() == [alarm]
    assert host.control.memory.programs == before


def test_an_empty_file_is_an_alarm() -> None:
    host = Host()
    assert host.load(b"%\r\n\r\n%\r\n") == "RS232 DONE"
    assert host.alarms() == ["empty-program"]


def test_a_file_without_its_last_percent_is_waited_for_until_reset() -> None:
    host = Host(xon_at_start=True)
    host.receive()
    host.send(b"%\nO00001\nG0\nM30\n")
    host.wait(1000.0)
    assert host.control.doing == "receiving programs"
    host.control.press_reset(host.now)
    assert host.control.screen == "RS232 ABORT"
    assert host.control.memory.programs["O00001"] == "O00001\nG0\nM30"


def test_or_it_ends_with_an_alarm_when_nothing_comes() -> None:
    host = Host(input_timeout_s=10, keeps_partial=False)
    host.receive()
    host.send(b"%\nO00001\nG0\n")
    host.wait(9.0)
    host.send(b"M30\n")
    host.wait(9.0)
    assert host.control.screen == ""
    host.wait(2.0)
    assert host.control.screen == "RS232 ABORT"
    assert host.alarms() == ["unexpected-end"]
    assert "O00001" not in host.control.memory.programs


def test_the_memory_is_full() -> None:
    host = Host(memory_bytes=1000)
    assert host.load(b"%\nO00001\n" + b"G0 X1.\n" * 200 + b"%\n") == "RS232 ABORT"
    assert host.alarms() == ["insufficient-memory"]
    assert host.control.memory.used_bytes <= 1000
    host = Host(max_programs=3)
    assert host.load(b"%\nO00001\nM30\n%\n") == "RS232 ABORT"
    assert host.alarms() == ["too-many-programs"]
    assert host.load(b"%\nO00010\nM30\n%\n") == "RS232 DONE"


@pytest.mark.parametrize("end", ["percent", "eob"])
def test_what_ends_a_receive_operation(end: str) -> None:
    host = Host(end_of_receive=end, profile="dc codes")
    host.receive()
    assert host.send(b"%\nO00001\nM30\n%") == (b"\x13" if end == "percent" else b"")
    assert host.send(b" \r") == (b"" if end == "percent" else b"\x13")
    assert host.control.screen == "RS232 DONE"


# Numbered data


@pytest.mark.parametrize("kind", ["parameters", "settings", "offsets", "macros"])
def test_numbered_data_go_out_and_come_back(kind: str) -> None:
    host = Host(v_digits=6)
    data = host.fetch(kind)
    lines = data.split(b"\r\n")
    assert lines[0] == b"%"
    assert lines[-2:] == [b"%", b""]
    assert lines[1].startswith(b"N0 V") == (kind != "macros")
    assert (lines[-3] == b"N9999 V0") == (kind == "macros")
    assert host.load(data, kind) == "RS232 DONE"
    assert not host.control.alarms
    assert host.fetch(kind) == data


@pytest.mark.parametrize("kind", ["parameters", "settings", "offsets"])
def test_an_old_checksum_is_an_alarm_and_the_data_are_loaded(kind: str) -> None:
    host = Host()
    data = host.fetch(kind)
    lines = data.split(b"\r\n")
    lines[2] = b"N1 V77"
    assert host.load(b"\r\n".join(lines), kind) == "RS232 DONE"
    assert host.alarms() == ["wrong-checksum"]
    assert host.control.alarms[0].number is None
    assert b"\r\nN1 V77\r\n" in host.fetch(kind)


@pytest.mark.parametrize("kind", ["settings", "offsets"])
def test_without_n0_settings_and_offsets_are_loaded_without_an_alarm(kind: str) -> None:
    host = Host()
    assert host.load(b"%\nN1 V77\n%\n", kind) == "RS232 DONE"
    assert not host.control.alarms
    assert b"\r\nN1 V77\r\n" in host.fetch(kind)


@pytest.mark.parametrize(("knob", "screen", "value"), [("refuse", "RS232 ABORT", "7919"), ("load", "RS232 DONE", "5")])
def test_parameters_need_n0(knob: str, screen: str, value: str) -> None:
    host = Host(parameters_without_n0=knob)
    assert host.load(b"%\nN1 V5\n%\n", "parameters") == screen
    assert host.alarms() == ["wrong-checksum"]
    assert host.control.memory.parameters[1] == value


@pytest.mark.parametrize(("needs", "alarms"), [(True, ["unexpected-end"]), (False, [])])
def test_macro_variables_need_n9999(needs: bool, alarms: list[str]) -> None:
    host = Host(needs_n9999=needs)
    assert host.load(b"%\nN100 V1.5\n%\n", "macros") == "RS232 DONE"
    assert host.alarms() == alarms
    assert host.control.memory.macros[100] == 1.5


@pytest.mark.parametrize(
    ("line", "alarm"),
    [
        (b"X1", "invalid-n-code"),
        (b"NX V1", "invalid-n-code"),
        (b"N8888 V1", "invalid-n-code"),
        (b"N1 W1", "invalid-v-code"),
        (b"N1 VX", "invalid-v-code"),
        (b"N1", "invalid-v-code"),
    ],
)
def test_a_line_that_is_none_is_an_alarm_and_the_others_are_loaded(line: bytes, alarm: str) -> None:
    host = Host()
    assert host.load(b"%\n" + line + b"\nN2 V3\n%\n", "settings") == "RS232 DONE"
    assert host.alarms() == [alarm]
    assert host.control.memory.settings[2] == "3"
    assert host.control.memory.settings[1] == "0"


def test_macro_variables_have_no_n0() -> None:
    host = Host()
    host.load(b"%\nN0 V5\nN100 V1\nN9999 V0\n%\n", "macros")
    assert host.alarms() == ["invalid-n-code"]


@pytest.mark.parametrize("keeps", [True, False])
def test_what_came_of_numbered_data_before_an_abort(keeps: bool) -> None:
    host = Host(keeps_partial=keeps)
    host.receive("offsets")
    host.send(b"%\nN1 V7\nN2")
    host.control.press_reset(host.now)
    assert host.control.screen == "RS232 ABORT"
    assert (host.control.memory.offsets[1] == "7") == keeps


# Damage


@pytest.mark.parametrize("fault", ["parity-error", "framing-error", "overrun", "break"])
def test_a_fault_of_a_byte_stops_the_receive_operation(fault: str) -> None:
    host = Host()
    host.control.trouble.spoil_byte(18, fault)  # type: ignore[arg-type]
    assert host.load(b"%\nO00001\nG0 X1\nG1 X2\nM30\n%\n") == "RS232 ABORT"
    assert host.alarms() == [fault]
    assert host.control.memory.programs["O00001"] == "O00001\nG0 X1"


def test_faults_come_by_chance_too() -> None:
    for knob in ("parity_fault", "framing_fault"):
        assert Host(**{knob: 1.0}).load(b"%\nO00001\n%\n") == "RS232 ABORT"
        host = Host(**{knob: 0.001}, seed=1)
        assert host.load(b"%\nO00001\n" + b"G0 X1.\n" * 2000 + b"%\n") == "RS232 ABORT"
        come = len(host.control.memory.programs["O00001"])
        assert 0 < come < 14_000


@pytest.mark.parametrize("parity", ["even", "odd", "zero"])
def test_the_parity_bit_is_seen_where_it_is_in_the_bytes(parity: str) -> None:
    host = Host(parity=parity, parity_in_bytes=True)
    sent = host.fetch("O01234")
    plain = bytes(byte & 0x7F for byte in sent)
    assert b"O01234" in plain
    ones = {byte.bit_count() % 2 for byte in sent}
    assert ones == ({0} if parity == "even" else {1} if parity == "odd" else {0, 1})
    assert sent.isascii() == (parity == "zero")
    assert host.load(sent) == "RS232 DONE"
    wrong = bytearray(sent)
    wrong[30] ^= 0x80
    assert host.load(bytes(wrong)) == "RS232 ABORT"
    assert host.alarms() == ["parity-error"]
    assert host.load(plain) == ("RS232 DONE" if parity == "zero" else "RS232 ABORT")


def test_without_it_a_port_of_seven_bits_hears_seven() -> None:
    host = Host(data_bits=7)
    assert host.load(b"%\nO00001\nM3\xb0\n%\n") == "RS232 DONE"
    assert host.control.memory.programs["O00001"] == "O00001\nM30"


def test_bytes_that_the_control_sends_are_spoilt_where_a_test_says_so_or_by_chance() -> None:
    right = Host().fetch("O01234")
    host = Host()
    host.control.trouble.spoil_sent_byte(20)
    host.control.trouble.spoil_sent_byte(40)
    wrong = host.fetch("O01234")
    assert [place for place, byte in enumerate(wrong) if byte != right[place]] == [20, 40]
    by_chance = Host(spoil_sent=0.05, seed=3).fetch("O01234")
    assert len(by_chance) == len(right)
    assert 1 <= sum(a != b for a, b in zip(by_chance, right, strict=True)) <= 20
    assert host.fetch("O01234") == right

"""`compax haas receive`, `send`, `query` and `watch` on simulated controls, and what is said where that goes wrong."""

from __future__ import annotations

import asyncio
import errno
import json
import re
import signal
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from compax_aio.cli import app
from compax_aio.cli.exchanging import sending
from compax_aio.haas.archive import Archive
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl
from compax_aio.simulator.server import control_named

PROGRAM = "%\nO00077 (NEW)\nG0 X1.\nM30\n%\n"
DC_CODES = ("--profile", "classic-dc-codes")
XMODEM = ("--profile", "classic-xmodem")
URL = "sim://haas?name=mill"


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


Compax = Callable[..., tuple[int, str]]
Plan = Callable[[float, Callable[..., object]], None]


@pytest.fixture
def mill() -> dict[str, Any]:
    """Knobs of the control; and the control of the last command, as ``far_end``."""
    return {"profile": "classic", "baudrate": 9600}


@pytest.fixture(autouse=True)
def on_stage(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mill: dict[str, Any]) -> Plan:
    """Let commands run in virtual time; something may be done to the control of each at a time."""
    monkeypatch.chdir(tmp_path)
    Path("new.nc").write_text(PROGRAM)
    deeds: list[tuple[float, Callable[..., object]]] = []

    def plan(at_s: float, deed: Callable[..., object]) -> None:
        deeds.append((at_s, deed))

    def run(coroutine: Coroutine[Any, Any, Any]) -> Any:
        async def played() -> Any:
            control = control_named("mill", Knobs(**{key: mill[key] for key in mill if key != "far_end"}))
            mill["far_end"] = control
            loop = asyncio.get_running_loop()
            for at_s, deed in deeds:
                loop.call_later(at_s, *((deed,) if deed is ctrl_c else (deed, control)))
            return await coroutine

        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(played())

    monkeypatch.setattr(asyncio, "run", run)
    return plan


@pytest.fixture
def compax(capsys: pytest.CaptureFixture[str]) -> Compax:
    """Carry out a command; gives its exit code, and all that it says."""

    def carry_out(*words: str) -> tuple[int, str]:
        code = app.run(["haas", *words])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return carry_out


def send(what: str) -> Callable[[SimulatedControl], None]:
    return lambda control: control.press_send(what)


def recv(what: str = "programs") -> Callable[[SimulatedControl], None]:
    return lambda control: control.press_recv(what)


# Receive ------------------------------------------------------------------------------------------------------------


def test_a_program_is_kept_byte_for_byte_and_its_proof_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O00010"))
    code, text = compax("receive", URL, "program", "--out", "ten.nc")
    assert code == 0
    data = Path("ten.nc").read_bytes()
    assert data.startswith(b"\r\n%\r\nO00010\r\n(POCKET)")
    assert data.endswith(b"%\r\n")
    assert "at the control, choose the program and press SEND" in text
    assert re.search(rf"ten\.nc: program, {len(data)} bytes in 0\.[0-9] s: O00010", text)
    assert "proved by silence after %; nothing on this line tells damage: --verify receives it twice" in text
    assert [each.name for each in Path().iterdir() if "incomplete" in each.name] == []


def test_without_a_name_it_gets_one_by_what_it_is_and_the_time(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O01234"))
    assert compax("receive", URL, "program")[0] == 0
    (file,) = Path().glob("O01234 *.nc")
    assert b"(FACE)" in file.read_bytes()


@pytest.mark.parametrize("kind", ["parameters", "settings", "offsets", "macros"])
@pytest.mark.parametrize("by", [("dc_codes", DC_CODES, "DC4 seen"), ("xmodem", XMODEM, "xmodem EOT")])
def test_numbered_data_come_by_any_synchronization(
    compax: Compax, on_stage: Plan, mill: dict[str, Any], kind: str, by: tuple[str, tuple[str, ...], str]
) -> None:
    mill["profile"], profile, proof = by
    on_stage(1.0, send(kind))
    code, text = compax("receive", URL, kind, "-o", "data.txt", *profile)
    assert code == 0
    assert f"data.txt: {kind}, " in text
    assert ("no N0" if kind == "macros" else " values, N0 ") in text
    assert proof in text


def test_all_programs_are_named_in_what_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("ALL"))
    code, text = compax("receive", URL, "programs", "-o", "all.nc")
    assert code == 0
    assert "O00010, O01234, O09810" in text


def test_verified_it_is_received_twice(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O00010"))
    on_stage(8.0, send("O00010"))
    code, text = compax("receive", URL, "program", "-o", "ten.nc", "--verify")
    assert code == 0
    assert "choose the program and press SEND once more, to be compared" in text
    assert "the same bytes came twice" in text


def test_what_comes_otherwise_the_second_time_is_kept_as_incomplete(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O00010"))
    on_stage(8.0, send("O01234"))
    code, text = compax("receive", URL, "program", "-o", "ten.nc", "--verify")
    assert code == 6
    assert "came twice, and not the same" in text
    assert not Path("ten.nc").exists()
    assert Path("ten.nc.incomplete").exists()
    assert text.count("ten.nc.incomplete") == 1


def test_a_file_that_is_there_is_not_written_over(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O00010"))
    Path("ten.nc").write_text("old")
    code, text = compax("receive", URL, "program", "-o", "ten.nc")
    assert code == 2
    assert "ten.nc is there already" in text
    assert compax("receive", URL, "program", "-o", "ten.nc", "--force")[0] == 0
    assert "O00010" in Path("ten.nc").read_text()


def test_a_file_that_came_there_meanwhile_is_left_as_it_is_and_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, lambda _: Path("ten.nc").write_text("somebody else's"))
    on_stage(2.0, send("O00010"))
    code, text = compax("receive", URL, "program", "--out", "ten.nc")
    assert code == 0
    assert "ten 2.nc: program," in text
    assert "was left as it is" in text
    assert Path("ten.nc").read_text() == "somebody else's"


def test_of_a_full_disk_nothing_is_said_that_only_programs_can_do(
    compax: Compax, on_stage: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(self: Archive, data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Archive, "_append", no_room)
    on_stage(1.0, send("O00010"))
    code, text = compax("receive", URL, "program", "--out", "ten.nc")
    assert code == 2
    assert "is the disk full? Receive it again when there is room" in text
    assert "not all that came is in" in text
    assert "error.data" not in text


@pytest.mark.parametrize("out", ["backup/", "nowhere/ten.nc", ""])
def test_a_folder_is_not_taken_for_a_file(compax: Compax, on_stage: Plan, out: str) -> None:
    code, text = compax("receive", URL, "program", "--out", out)
    assert code == 2
    assert "there is no folder" in text
    Path("backup").mkdir()
    on_stage(1.0, send("O01234"))
    assert compax("receive", URL, "program", "--out", "backup/")[0] == 0
    assert len(list(Path("backup").glob("O01234 *.nc"))) == 1


def test_nobody_presses_send(compax: Compax) -> None:
    code, text = compax("receive", URL, "program", "-o", "ten.nc", "--operator-timeout", "5")
    assert code == 4
    assert "the control did not send the program in time" in text
    assert "Settings 11 (baud rate), 12 (parity)" in text
    assert "what came is in" not in text
    assert list(Path().glob("ten*")) == []


def test_an_interruption_leaves_what_came_as_incomplete(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["program_blocks"] = 500
    on_stage(1.0, send("O00010"))
    on_stage(3.0, ctrl_c)
    code, text = compax("receive", URL, "program", "-o", "ten.nc")
    assert code == 130
    assert "Interrupted. program: the transfer was given up;" in text
    assert "ten.nc.incomplete." in text
    came = Path("ten.nc.incomplete").read_bytes()
    assert f"{len(came)} bytes came" in text
    assert not Path("ten.nc").exists()


def test_an_interruption_before_anything_came_leaves_no_file(compax: Compax, on_stage: Plan) -> None:
    on_stage(3.0, ctrl_c)
    code, text = compax("receive", URL, "program", "-o", "ten.nc")
    assert code == 130
    assert "nothing of the file came. No file was written." in text
    assert list(Path().glob("ten*")) == []


def test_what_is_damaged_is_kept_only_if_that_is_wanted(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill.update(parity_in_bytes=True, spoil_sent=0.01, seed=2)
    on_stage(1.0, send("O00010"))
    words = ("receive", URL, "program", "-o", "ten.nc", "--parity-in", "bytes")
    code, text = compax(*words)
    assert code == 6
    assert "1 byte cannot be right, at offset 76" in text
    assert "--accept-damaged" in text
    assert not Path("ten.nc").exists()
    code, text = compax(*words, "--accept-damaged")
    assert code == 0
    assert "1 byte cannot be right, at offset 76" in text
    assert Path("ten.nc").exists()


def test_programs_read_what_came_and_are_told_what_somebody_has_to_do(
    on_stage: Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    on_stage(1.0, send("settings"))
    assert app.run(["haas", "receive", URL, "settings", "-o", "s.txt", "--json"]) == 0
    captured = capsys.readouterr()
    asked, told = map(json.loads, captured.out.splitlines())
    assert asked == {"transfer": "settings", "operator": "at the control, show the settings and press SEND"}
    assert told["bytes"] == Path("s.txt").stat().st_size
    assert told["contents"]["values"] == 62
    assert told["received"]["verified"] is None
    assert captured.err == ""


# Send ---------------------------------------------------------------------------------------------------------------


def test_what_was_sent_is_not_called_stored(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "dc_codes"
    on_stage(1.0, recv())
    code, text = compax("send", URL, "new.nc", *DC_CODES)
    assert code == 0
    assert "at the control, show the list of programs and press RECV" in text
    assert "new.nc: sent, 35 bytes" in text
    assert "proved: reader off seen" in text
    assert "only its screen shows: RS232 DONE or RS232 ABORT" in text
    assert "stored" not in text.split("only its screen")[0]
    assert mill["far_end"].memory.programs["O00077"].startswith("O00077")


def test_read_back_it_is_proved_to_be_stored(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "xmodem"
    on_stage(1.0, recv())
    on_stage(8.0, send("O00077"))
    code, text = compax("send", URL, "new.nc", *XMODEM, "--verify")
    assert code == 0
    assert "new.nc: sent and read back, 29 bytes in 1 blocks" in text
    assert "it has stored it" in text


def test_several_programs_go_in_one_transfer(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "dc_codes"
    Path("other.nc").write_text("%\nO00078\nM30\n%\n")
    on_stage(1.0, recv())
    code, text = compax("send", URL, "new.nc", "other.nc", *DC_CODES)
    assert code == 0
    assert {"O00077", "O00078"} <= mill["far_end"].memory.programs.keys()
    assert "new.nc, other.nc: sent" in text


def test_a_file_of_several_programs_is_sent(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "dc_codes"
    Path("two.nc").write_text("%\nO00077\nM30\nO00078\nM30\n%\n")
    on_stage(1.0, recv())
    assert compax("send", URL, "two.nc", *DC_CODES)[0] == 0
    assert {"O00077", "O00078"} <= mill["far_end"].memory.programs.keys()


def test_where_the_control_does_not_say_that_it_is_ready_somebody_has_to(compax: Compax) -> None:
    code, text = compax("send", URL, "new.nc")
    assert code == 2
    assert "the control does not say when RECV is pressed, and nobody is at a terminal" in text
    assert "--ready" in text


def test_a_control_that_holds_the_line_at_the_end_is_not_told_as_a_part_of_what_it_took(
    compax: Compax, on_stage: Plan, mill: dict[str, Any]
) -> None:
    mill["synchronization"] = "dc codes"  # its DC3 behind the last % is Xoff to this profile
    on_stage(0.0, recv())
    code, text = compax("send", URL, "new.nc", "--ready")
    assert code == 0
    assert re.search(r"bytes in [0-9.]+ s; the control held the line for [0-9.]+ s proved", text)


def test_somebody_may_have_pressed_recv_in_advance(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    on_stage(0.0, recv())
    code, text = compax("send", URL, "new.nc", "--ready")
    assert code == 0
    assert "proved: left the line" in text
    assert "O00077" in mill["far_end"].memory.programs


@pytest.mark.parametrize(
    "given",
    [
        ("settings old.txt", "%\nN1 V5\n%\n", "settings"),
        ("offsets-old.txt", "%\nN1 V5\n%\n", "offsets"),
        ("any.txt", "%\nN100 V1.5\nN9999 V0\n%\n", "macros"),
    ],
)
def test_numbered_data_are_recognised_and_sent(
    compax: Compax, on_stage: Plan, mill: dict[str, Any], given: tuple[str, str, str]
) -> None:
    mill["profile"] = "dc_codes"
    name, text, kind = given
    Path(name).write_text(text)
    on_stage(1.0, recv(kind))
    code, said = compax("send", URL, name, *DC_CODES)
    assert code == 0
    assert f"{kind if kind != 'macros' else 'macro variables'} and press RECV" in said
    assert "data are loaded even where there is an alarm" in said
    assert mill["far_end"].log.texts(LogKind.STORED)[-1].startswith(kind)


PARAMETERS = "%\nN0 V1\nN1 V5\n%\n"


def test_parameters_need_a_long_word_and_a_yes(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "dc_codes"
    Path("parameters.txt").write_text(PARAMETERS)
    on_stage(1.0, recv("parameters"))
    code, text = compax("send", URL, "parameters.txt", *DC_CODES, "--yes")
    assert code == 2
    assert "--i-know-parameters-take-effect" in text
    assert "far_end" not in mill or not mill["far_end"].received_bytes
    words = ("send", URL, "parameters.txt", *DC_CODES, "--i-know-parameters-take-effect")
    code, text = compax(*words)
    assert code == 2
    assert "nobody is at a terminal; say --yes" in text
    assert compax(*words, "--yes")[0] == 0
    assert mill["far_end"].memory.parameters[1] == "5"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "no file was named"),
        (("any.txt",), "nothing says what the numbers are"),
        (("any.txt", "other.txt", "--kind", "settings"), "one file in a transfer"),
        (("new.nc", "new.nc", "--dnc"), "one program alone is fed by DNC"),
        (("new.nc", "--dnc", "--verify"), "cannot be read back"),
        (("nowhere.nc",), "nowhere.nc cannot be read: No such file"),
        (("bad.nc",), "2:3: 'x' is a small letter outside of a comment"),
        (("new.nc", "--profile", "nobodys"), "no profile"),
        (("new.nc", "--profile", "data-collection-19200", "--ready"), "has no synchronization"),
        (("new.nc", "--ready", "--operator-timeout", "0"), "operator_timeout_s"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_a_byte_is_sent(
    compax: Compax, mill: dict[str, Any], words: tuple[str, ...], says: str
) -> None:
    Path("any.txt").write_text("%\nN1 V5\n%\n")
    Path("other.txt").write_text("%\nN1 V5\n%\n")
    Path("bad.nc").write_text("%\nO1x\nM30\n%\n")
    code, text = compax("send", URL, *words)
    assert code == 2
    assert says in text
    assert "far_end" not in mill or not mill["far_end"].received_bytes


def test_many_errors_are_not_all_told(compax: Compax) -> None:
    Path("bad.nc").write_text("%\nO1\n" + "g0\n" * 15 + "%\n")
    code, text = compax("send", URL, "bad.nc", "--ready")
    assert code == 2
    assert "there are 15 errors in the file:" in text
    assert "and 5 more, which `compax haas check` tells" in text


def test_a_program_is_fed_while_the_machine_runs_it(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill.update(profile="dc_codes", dnc_block_s=0.5)
    on_stage(1.0, SimulatedControl.press_dnc)
    code, text = compax("send", URL, "new.nc", *DC_CODES, "--dnc", "--yes")
    assert code == 0
    assert "press MDI/DNC twice" in text
    assert "new.nc: fed, 35 bytes" in text
    assert "only its screen shows: whether the machine has run it to its end" in text
    assert "O00077" not in mill["far_end"].memory.programs


def test_who_is_not_asked_is_told_to_say_yes(compax: Compax) -> None:
    code, text = compax("send", URL, "new.nc", *DC_CODES, "--dnc")
    assert code == 2
    assert "say --yes" in text


def test_an_interruption_sends_no_more_and_says_what_went(compax: Compax, on_stage: Plan, mill: dict[str, Any]) -> None:
    mill["profile"] = "dc_codes"
    Path("long.nc").write_text("%\nO00077\n" + "G1 X1.5 Y2.5\n" * 500 + "M30\n%\n")
    on_stage(1.0, recv())
    on_stage(3.0, ctrl_c)
    code, text = compax("send", URL, "long.nc", *DC_CODES)
    assert code == 130
    assert "Interrupted. long.nc: the transfer was given up;" in text
    assert re.search(r"[0-9]+ of [0-9]+ bytes have left, [0-9]+ whole lines", text)
    assert "The control waits for the rest: press RESET there. It may have stored what it has got." in text
    assert 0 < mill["far_end"].received_bytes < 2500


def test_an_interruption_while_it_is_read_back_says_that_all_has_left(
    compax: Compax, on_stage: Plan, mill: dict[str, Any]
) -> None:
    mill["profile"] = "dc_codes"
    on_stage(1.0, recv())
    on_stage(10.0, ctrl_c)
    code, text = compax("send", URL, "new.nc", *DC_CODES, "--verify")
    assert code == 130
    assert "All of it has left; whether the control has stored it, its screen shows." in text
    assert "waits for the rest" not in text


def test_an_interruption_before_anything_went_says_so(compax: Compax, on_stage: Plan) -> None:
    on_stage(3.0, ctrl_c)
    code, text = compax("send", URL, "new.nc", *DC_CODES)
    assert code == 130
    assert "nothing of the file was sent. The control, if it waits, waits on: press RESET there." in text


def test_an_interrupted_drip_feed_says_what_the_machine_does(
    compax: Compax, on_stage: Plan, mill: dict[str, Any]
) -> None:
    mill.update(profile="dc_codes", dnc_block_s=0.5)
    Path("long.nc").write_text("%\nO00077\n" + "G1 X1.5 Y2.5\n" * 500 + "M30\n%\n")
    on_stage(1.0, SimulatedControl.press_dnc)
    on_stage(5.0, ctrl_c)
    code, text = compax("send", URL, "long.nc", *DC_CODES, "--dnc", "--yes", "--json")
    assert code == 130
    last = json.loads(text[text.rindex('{"transfer"') :].split("} ")[0])
    assert last["interrupted"] is True
    assert last["account"]["kind"] == "drip feed"


def test_an_error_tells_programs_how_far_it_came(
    on_stage: Plan, mill: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    mill["profile"] = "dc_codes"
    on_stage(1.0, recv())
    on_stage(1.5, lambda control: control.power_off())
    Path("long.nc").write_text("%\nO00077\n" + "G1 X1.5 Y2.5\n" * 500 + "M30\n%\n")
    code = app.run(["haas", "send", URL, "long.nc", *DC_CODES, "--json"])
    captured = capsys.readouterr()
    if code == 0:  # with DC codes nothing comes back in the middle: the end is what is missed
        (told,) = (json.loads(line) for line in captured.out.splitlines() if '"sent"' in line)
        assert told["sent"]["proof"] == "left the line"
        assert told["sent"]["warnings"]
    else:
        assert json.loads(captured.err.splitlines()[-1])["error"]["transfer"]["way"] == "send"


def test_what_goes_over_the_line_is_recorded(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("O00010"))
    assert compax("receive", URL, "program", "-o", "ten.nc", "--trace", "trace.jsonl")[0] == 0
    assert Path("trace.jsonl").stat().st_size > 0


@pytest.mark.parametrize("typed", [("yes", 1), ("PARAMETERS", 0)])
def test_a_word_is_typed_for_parameters(
    compax: Compax, on_stage: Plan, mill: dict[str, Any], monkeypatch: pytest.MonkeyPatch, typed: tuple[str, int]
) -> None:
    mill["profile"] = "dc_codes"
    answer, code = typed
    asked: list[str] = []

    async def answer_to(question: str) -> str:
        asked.append(question)
        return answer

    monkeypatch.setattr(sending, "answer_to", answer_to)
    monkeypatch.setattr(sending, "expect_somebody", lambda **_: None)
    Path("parameters.txt").write_text(PARAMETERS)
    on_stage(1.0, recv("parameters"))
    said, text = compax("send", URL, "parameters.txt", *DC_CODES, "--i-know-parameters-take-effect")
    assert said == code
    assert "wrong ones can damage the machine. To send parameters.txt to sim://haas?name=mill, type" in asked[0]
    assert ("Nothing was sent." in text) is (code == 1)


@pytest.mark.parametrize("typed", [(False, 1), (True, 0)])
def test_it_is_asked_whether_the_machine_is_clear(
    compax: Compax, on_stage: Plan, mill: dict[str, Any], monkeypatch: pytest.MonkeyPatch, typed: tuple[bool, int]
) -> None:
    mill["profile"] = "dc_codes"
    answer, code = typed

    async def confirm(_: str) -> bool:
        return answer

    monkeypatch.setattr(sending, "confirm", confirm)
    monkeypatch.setattr(sending, "expect_somebody", lambda **_: None)
    on_stage(1.0, SimulatedControl.press_dnc)
    assert compax("send", URL, "new.nc", *DC_CODES, "--dnc")[0] == code


def test_what_is_odd_about_a_file_is_told_and_so_is_a_code_that_does_not_come(
    compax: Compax, on_stage: Plan, mill: dict[str, Any]
) -> None:
    mill.update(profile="dc_codes", drop_dc3=True)
    Path("odd.nc").write_text("%\nO00077\nG0 (OPEN\nM30\n%\n")
    on_stage(1.0, recv())
    code, text = compax("send", URL, "odd.nc", *DC_CODES)
    assert code == 0
    assert "odd.nc:3:4: warning: a comment that does not end in its line" in text
    assert "odd.nc: the control has not said that it has read the last % (DC3)" in text


def test_what_is_odd_about_what_came_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, send("ALL"))
    code, text = compax("receive", URL, "program", "-o", "all.nc")
    assert code == 0
    assert "3 programs came, and one was expected: was ALL chosen at the control?" in text


# Query and watch ----------------------------------------------------------------------------------------------------


def test_all_that_is_known_is_asked_if_nothing_is_named(compax: Compax) -> None:
    code, text = compax("query", URL)
    assert code == 0
    for each in ("Q100 serial number 1234567", "Q104 mode MEM", "Q201 tool in use 4", "Q500 program, status, parts"):
        assert each in text
    assert "O00010, IDLE, 42 parts" in text
    assert "power-on time 0:00:0" in text


def test_variables_are_named_by_their_numbers(compax: Compax) -> None:
    code, text = compax("query", URL, "3027", "150", "Q600 5021")
    assert code == 0
    assert "Q600 3027 spindle speed in rpm 0" in text
    assert "Q600 150 a variable empty (#0)" in text
    assert "Q600 5021 X machine position 1.5" in text


def test_a_busy_control_is_in_a_state_and_not_in_error(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, SimulatedControl.cycle_start)
    code, text = compax("query", URL, "Q500")
    assert code == 0
    assert "busy: a cycle runs" in text


def test_a_question_that_is_not_known_is_told_and_the_others_answered(
    capsys: pytest.CaptureFixture[str], on_stage: Plan
) -> None:
    assert app.run(["haas", "query", URL, "Q999", "Q100", "Q300", "Q500", "--json"]) == 5
    (told,) = map(json.loads, capsys.readouterr().out.splitlines())
    refused, serial, power, program = told["answers"]
    assert refused["value"] is None
    assert "UNKNOWN" in refused["error"]
    assert (serial["value"], serial["text"], serial["error"]) == ("1234567", "S/N, 1234567", None)
    assert isinstance(power["value"], float)
    assert program["value"] == {"busy": False, "program": "O00010", "status": "IDLE", "parts": 42}


def test_a_silent_control_is_told_of(compax: Compax, mill: dict[str, Any]) -> None:
    mill["data_collection"] = "off"
    code, text = compax("query", URL, "Q100", "--answer-timeout", "1")
    assert code == 4
    assert "AnswerTimeoutError" in text
    assert "143" in text


@pytest.mark.parametrize("word", ["Z5", "Q600", "E100 5", "999999"])
def test_what_is_no_question_is_refused(compax: Compax, word: str) -> None:
    assert compax("query", URL, word)[0] == 2
    assert compax("watch", URL, word)[0] == 2


def test_it_is_watched_until_it_has_said_enough(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.5, SimulatedControl.cycle_start)
    on_stage(2.5, lambda control: control.dprnt("PART*7"))
    code, text = compax("watch", URL, "Q500", "3027", "--count", "4")
    assert code == 0
    assert "Q500 O00010, IDLE, 42 parts 3027 0" in text
    assert "Q500 busy: a cycle runs 3027 3000" in text
    assert "printed: PART 7" in text


def test_programs_read_readings_and_events(on_stage: Plan, capsys: pytest.CaptureFixture[str]) -> None:
    on_stage(1.2, lambda control: control.dprnt("PART*7"))
    assert app.run(["haas", "watch", URL, "Q500", "Q999", "--count", "2", "--json"]) == 0
    documents = list(map(json.loads, capsys.readouterr().out.splitlines()))
    readings = [each for each in documents if "values" in each]
    assert readings[0]["values"]["Q500"]["status"] == "IDLE"
    assert "Q999" in readings[0]["errors"]
    assert {"event": "printed", "text": "PART 7"} in documents


def test_an_answer_to_somebody_else_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.5, lambda control: control.overhear("S/N, 7"))
    code, text = compax("watch", URL, "Q500", "--count", "3")
    assert code == 0
    assert "overheard: S/N, 7" in text


def test_watching_ends_by_ctrl_c(compax: Compax, on_stage: Plan) -> None:
    on_stage(2.2, ctrl_c)
    code, text = compax("watch", URL)
    assert code == 130
    assert "Watched no longer." in text
    assert "Q104 MEM" in text


def test_haste_is_refused(compax: Compax) -> None:
    code, text = compax("watch", URL, "--interval", "0.2")
    assert code == 2
    assert "interval" in text

"""``compax probe``: says what it found and how well that is founded, writes a settings file, and moves nothing."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.fakes.commands import Commands
from tests.fakes.scripted import ScriptedFarEnd

from compax_aio import DriveSettings
from compax_aio.compax import probing
from compax_aio.compax.facts.line import BAUD_RATES
from compax_aio.compax.facts.status import MARKERS
from compax_aio.compax.findings import ErrorStyle, Founded
from compax_aio.compax.plain_line import starts_motion
from compax_aio.compax.probing import UNKNOWN_STATUS, candidates, probe
from compax_aio.errors import AnswerTimeoutError, ConnectionLostError, TransportError, UnexpectedAnswerError
from compax_aio.link.link import Link
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.rates import heard
from compax_aio.simulator.server import serve_loopback, serve_pty
from compax_aio.transports.loopback import listen

QUERY = re.compile(r"S(1?\d|30|3[1-9])|P(19|20|90|11|12)|S999")
MOTION = (LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED, LogKind.OUTPUT, LogKind.PROGRAM, LogKind.QUIT)

numbers = itertools.count()


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


def found(report: Any, topic: str) -> Any:
    (finding,) = (each for each in report.findings if each.topic == topic)
    return finding


async def probed(knobs: Knobs | None = None, **options: Any) -> Any:
    drive = SimulatedDrive(knobs or Knobs())
    async with serve_loopback(drive, f"probed-{next(numbers)}") as url:
        return await probe(url, **options)


# Nothing is moved -----------------------------------------------------------------------------------------------------


def knobs_of_all_kinds() -> st.SearchStrategy[Knobs]:
    """Draw every knob that has choices, and P20 from all that it can be."""
    choices = {
        name: st.sampled_from([False, True] if hint is bool else get_args(hint))
        for name, hint in get_type_hints(Knobs).items()
        if hint is bool or get_origin(hint) is Literal
    }
    return st.builds(Knobs, p20=st.integers(0, 255), self_test_s=st.sampled_from([0.0, 60.0]), **choices)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(knobs_of_all_kinds(), st.sampled_from([None, 55, 60]))
def test_every_line_that_any_drive_receives_is_a_query(knobs: Knobs, fault: int | None) -> None:
    loop = VirtualClockLoop()
    drive = SimulatedDrive(knobs)

    async def look() -> None:
        if fault is not None:
            drive.raise_fault(fault)
        async with serve_loopback(drive, f"drawn-{next(numbers)}") as url:
            report = await probe(url)
        assert report.settings.message_form.name == "UNKNOWN"
        assert report.echo is knobs.echo

    loop.run_until_complete(look())
    loop.run_until_complete(loop.shutdown_default_executor())
    loop.close()
    lines = drive.log.texts(LogKind.LINE)
    assert lines
    assert [line for line in lines if not QUERY.fullmatch(line)] == []
    assert not any(starts_motion(line) for line in lines)
    assert drive.log.texts(*MOTION) == []


@pytest.mark.parametrize("echoes", [False, True])
async def test_until_a_compax_has_answered_nothing_but_status_is_asked(echoes: bool) -> None:
    far = ScriptedFarEnd(lambda text: text.encode() if echoes else b"what?\r\n")
    name = f"stranger-{next(numbers)}"
    with await listen(name, lambda: far), pytest.raises((AnswerTimeoutError, UnexpectedAnswerError)):
        await probe(f"loop://{name}")
    assert far.lines
    assert {line[0] for line in far.lines} == {"S"}


@pytest.mark.parametrize(("ours", "drives"), [BAUD_RATES, BAUD_RATES[::-1]])
def test_what_a_drive_hears_of_our_queries_at_the_other_rate_is_no_line_and_no_frame(ours: int, drives: int) -> None:
    for number in (*MARKERS, 999):
        noise = heard(f"S{number}\r".encode(), ours, drives)
        assert noise, "it hears something"
        assert b"\r" not in noise, "it would carry out what stands in its buffer"
        assert noise[0] < 0x80, "with binary transfer on, a frame would begin"


@pytest.mark.real_time
@pytest.mark.parametrize("p20", [0, 16, 19])
async def test_at_the_wrong_rate_nothing_is_done_and_the_right_one_is_found(p20: int) -> None:
    drive = SimulatedDrive(Knobs(baudrate=4800, p20=p20))
    async with serve_pty(drive) as url:
        port = url.partition("?")[0]
        report = await probe(port, settings=DriveSettings(answer_timeout_s=0.4))
    assert report.baudrate == 4800
    assert [(each.baudrate, each.answers) for each in report.attempts] == [(9600, False), (4800, True)]
    assert "baudrate=4800" in report.url
    assert ("xonxoff=1" in report.url) is bool(p20 & 1)
    assert found(report, "baud rate").founded is Founded.SEEN
    assert report.cts is None, "a pseudo-terminal has no such line"
    assert drive.log.texts(*MOTION) == []


def test_the_query_that_is_to_be_refused_is_one_by_its_form_and_has_no_meaning() -> None:
    assert not starts_motion(UNKNOWN_STATUS)
    assert int(UNKNOWN_STATUS[1:]) > 250


# What is found --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("knobs", "style", "verifies"),
    [
        ({}, ErrorStyle.CODE, False),
        ({"error_style": "text"}, ErrorStyle.CODE_AND_TEXT, False),
        ({"error_style": "prompt_only"}, ErrorStyle.PROMPT_ONLY, True),
        ({"error_style": "silent"}, ErrorStyle.SILENT, True),
        ({"p20": 3}, ErrorStyle.PROMPT_ONLY, True),
    ],
)
async def test_the_form_of_refusals_is_seen(knobs: dict[str, Any], style: ErrorStyle, verifies: bool) -> None:
    report = await probed(Knobs(**knobs))
    assert report.error_style is style
    assert found(report, "errors").founded is Founded.SEEN
    assert report.settings.verify_messages is verifies
    assert ("verify_messages" in report.changed) is verifies


@pytest.mark.parametrize("echo", [False, True])
@pytest.mark.parametrize("padding", ["none", "blanks", "unit"])
async def test_an_echo_is_told_from_an_answer(echo: bool, padding: Any) -> None:
    report = await probed(Knobs(echo=echo, reply_padding=padding))
    assert report.echo is echo


async def test_the_settings_differ_only_in_what_was_found() -> None:
    assert (await probed()).settings == DriveSettings()
    report = await probed(Knobs(reply_padding="unit", decimals=3, travel_min=-10, travel_max=500))
    assert report.settings == DriveSettings(unit="mm", decimals=3, travel=(-10, 500))
    assert set(report.changed) == {"unit", "decimals", "travel"}


async def test_what_the_user_has_said_is_not_overruled() -> None:
    given = DriveSettings(unit="inch", travel=(0, 10))
    report = await probed(Knobs(reply_padding="unit", travel_min=-10, travel_max=500), settings=given)
    assert report.settings == given


async def test_a_slow_drive_is_given_more_time() -> None:
    report = await probed(Knobs(answer_time_s=0.4))
    assert report.settings.answer_timeout_s == pytest.approx(1.7, abs=0.11)
    assert "slowest" in report.changed["answer_timeout_s"]


async def test_p20_is_decoded_and_unknown_bits_are_told() -> None:
    report = await probed(Knobs(p20=4 + 16))
    assert report.interface is not None
    assert report.interface.binary
    assert "unknown meaning, 4 together" in found(report, "P20").found


async def test_the_message_stays_unknown_and_the_report_says_why() -> None:
    finding = found(await probed(), "$ message")
    assert finding.founded is Founded.UNKNOWN
    assert "moves nothing" in finding.evidence


async def test_a_message_of_somebody_elses_move_is_told_and_proves_no_form() -> None:
    drive = SimulatedDrive(Knobs(answer_time_s=0.05))
    async with serve_loopback(drive, "busy") as url:
        drive.receive(b"PA50$\r", 0.0)
        report = await probe(url)
    finding = found(report, "$ message")
    assert "somebody else" in finding.evidence
    assert finding.founded is Founded.UNKNOWN


async def test_a_fault_is_told_with_its_code() -> None:
    drive = SimulatedDrive(Knobs())
    async with serve_loopback(drive, "faulty") as url:
        drive.raise_fault(55)
        drive.raise_fault(60)
        report = await probe(url)
    assert "E55, emergency stop" in found(report, "state").found


def answering(answers: dict[str, bytes | None]) -> ScriptedFarEnd:
    """Play a drive that answers every query by 0, but for some."""

    def script(text: str) -> bytes | None:
        usual = f"{text[0]}{int(text[1:]):03d}: 00000000\r\n>".encode()
        return answers.get(text, b"E90\r\n>" if text == UNKNOWN_STATUS else usual)

    return ScriptedFarEnd(script)


async def probed_as(answers: dict[str, bytes | None], **options: Any) -> Any:
    name = f"scripted-{next(numbers)}"
    with await listen(name, lambda: answering(answers)):
        return await probe(f"loop://{name}", **options)


async def test_what_a_drive_refuses_is_left_out_and_told() -> None:
    queries = ("P20", "P19", "P90", "P11", "P12", "S1", "S30", "S16", *(f"S{number}" for number in range(31, 40)))
    report = await probed_as(dict.fromkeys(queries, b"E90\r\n>"))
    assert report.interface is None
    assert report.identification == {}
    for topic in ("P20", "axis", "state", "identification"):
        assert found(report, topic).founded is Founded.UNKNOWN, topic
    assert "E90" in found(report, "P20").evidence


async def test_a_query_that_is_not_answered_ends_nothing() -> None:
    report = await probed_as({"S18": None, "P20": b"P020: 0.5\r\n>"})
    assert report.error_style is ErrorStyle.CODE
    assert report.interface is None
    assert found(report, "state").founded is Founded.READ


@pytest.mark.parametrize(
    ("answer", "style", "says"),
    [
        (b"syntax error\r\n>", ErrorStyle.OTHER_TEXT, "error_pattern"),
        (b"E07\r\n>", ErrorStyle.CODE, "its code alone"),
        (b"E07 no\r\n>", ErrorStyle.CODE_AND_TEXT, "with text"),
        (b"S999: 5\r\n>", ErrorStyle.UNKNOWN, "refused nothing"),
    ],
)
async def test_odd_answers_to_the_query_that_no_drive_has_are_told(answer: bytes, style: ErrorStyle, says: str) -> None:
    report = await probed_as({UNKNOWN_STATUS: answer})
    assert report.error_style is style
    assert says in found(report, "errors").found


async def test_an_error_that_p20_should_suppress_is_told_as_a_contradiction() -> None:
    report = await probed_as({"P20": b"P020: 3\r\n>"})
    assert "says otherwise" in found(report, "errors").evidence


async def test_an_echo_now_and_then_is_not_taken_for_one() -> None:
    report = await probed_as({"S2": b"S2\rS002: 0.00\r\n>"})
    assert report.echo is None
    assert "somebody else" in found(report, "echo").found


async def test_of_an_echo_nothing_is_claimed_where_nothing_was_answered() -> None:
    markers = iter([b"S017: 00000000\r\n>"])
    name = f"refusing-{next(numbers)}"
    with await listen(name, lambda: ScriptedFarEnd(lambda _: next(markers, b"E90\r\n>"))):
        report = await probe(f"loop://{name}")
    finding = found(report, "echo")
    assert (report.echo, finding.found, finding.founded) == (None, "not known", Founded.UNKNOWN)


async def test_that_the_axis_stands_is_not_claimed_of_a_bit_that_does_not_say_so() -> None:
    assert "no positioning runs" in found(await probed(), "state").found


async def test_s16_that_is_no_status_is_not_decoded() -> None:
    report = await probed_as({"S16": b"S016: what\r\n>"})
    assert found(report, "state").founded is Founded.UNKNOWN


async def test_a_self_test_is_told_as_what_it_may_be() -> None:
    report = await probed_as({"S16": b"S016: 00000000\r\n>", "S30": b"S030: 0 0\r\n>"})
    assert "self-test" in found(report, "state").found


@pytest.mark.parametrize(("cts", "says"), [(True, "rtscts=1 can be used"), (False, "would hold the line")])
async def test_cts_is_told_where_the_port_shows_it(cts: bool, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Link, "extra_info", lambda _, name: object() if name == "serial" else None)
    monkeypatch.setattr(probing, "cts_level", lambda _: cts)
    report = await probed()
    assert report.cts is cts
    assert says in found(report, "handshake").evidence


# Nobody, or somebody else ---------------------------------------------------------------------------------------------


async def test_silence_is_told_with_what_to_check() -> None:
    drive = SimulatedDrive()
    drive.silent = True
    async with serve_loopback(drive, "silent") as url:
        with pytest.raises(AnswerTimeoutError, match=r"no COMPAX answers; nothing came at all.*powered.*crossed"):
            await probe(url)


async def test_garbage_is_told_as_such() -> None:
    name = f"garbage-{next(numbers)}"
    with (
        await listen(name, lambda: ScriptedFarEnd(lambda _: b"\xf9\x80")),
        pytest.raises(AnswerTimeoutError, match="does not read well") as raised,
    ):
        await probe(f"loop://{name}")
    assert raised.value.received is not None


async def test_the_probe_ends_in_time_whatever_the_drive_does() -> None:
    with pytest.raises(AnswerTimeoutError, match="not over within 5 s"):
        await probed_as({f"S{number}": None for number in range(31, 40)}, timeout_s=5)


async def test_a_line_that_is_lost_ends_the_probe() -> None:
    def script(text: str) -> bytes | None:
        if text == "P20":
            far.transport.abort()
            return None
        return f"{text[0]}{int(text[1:]):03d}: 00000000\r\n>".encode()

    far = ScriptedFarEnd(script)
    name = f"lost-{next(numbers)}"
    with await listen(name, lambda: far), pytest.raises(ConnectionLostError):
        await probe(f"loop://{name}")


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("tcp://a:1", [(None, "tcp://a:1")]),
        ("serial:///dev/x", [(9600, "serial:///dev/x?baudrate=9600"), (4800, "serial:///dev/x?baudrate=4800")]),
        (
            "serial://?serial_number=A1&baudrate=4800",
            [
                (4800, "serial://?serial_number=A1&baudrate=4800"),
                (9600, "serial://?serial_number=A1&baudrate=9600"),
            ],
        ),
        (
            "rfc2217://a:1?baudrate=19200&rtscts=1",
            [
                (19200, "rfc2217://a:1?rtscts=1&baudrate=19200"),
                (9600, "rfc2217://a:1?rtscts=1&baudrate=9600"),
                (4800, "rfc2217://a:1?rtscts=1&baudrate=4800"),
            ],
        ),
    ],
)
def test_the_rates_that_are_tried(url: str, expected: list[tuple[int | None, str]]) -> None:
    assert candidates(url, BAUD_RATES) == expected


def test_a_baud_rate_that_is_none_is_refused() -> None:
    with pytest.raises(TransportError, match="baudrate"):
        candidates("serial:///dev/x?baudrate=fast", BAUD_RATES)


# The command ----------------------------------------------------------------------------------------------------------


def test_the_command_shows_every_finding_with_how_well_it_is_founded(compax: Commands) -> None:
    drive = compax.drive("x")
    outcome = compax("probe", "sim://compax?name=x")
    assert outcome.code == 0
    for topic in ("baud rate", "handshake", "echo", "errors", "P20", "$ message", "identification", "axis", "state"):
        assert topic in outcome.out
    for word in ("seen", "read", "inferred", "unknown"):
        assert word in outcome.out
    assert "Next: compax info 'sim://compax?name=x'" in outcome.told
    assert "need not differ" in outcome.out
    assert drive.log.texts(*MOTION) == []


def test_the_command_writes_a_settings_file_that_can_be_used(compax: Commands, tmp_path: Path) -> None:
    compax.drive("x", Knobs(travel_min=-10, travel_max=500))
    path = tmp_path / "drive.toml"
    outcome = compax("probe", "sim://compax?name=x", "-o", str(path))
    assert outcome.code == 0
    assert DriveSettings.load(path) == DriveSettings(travel=(-10, 500))
    assert "travel = (-10.0, 500.0), because: P11 and P12" in outcome.told
    assert f"--settings {path}" in outcome.told
    assert compax("info", "sim://compax?name=x", "--settings", str(path)).code == 0


def test_a_file_that_is_there_is_replaced_only_by_force_and_nothing_is_asked_before(
    compax: Commands, tmp_path: Path
) -> None:
    drive = compax.drive("x")
    path = tmp_path / "drive.toml"
    path.write_text("mine")
    outcome = compax("probe", "sim://compax?name=x", "-o", str(path))
    assert outcome.code == 2
    assert "there already" in outcome.err
    assert "--force" in outcome.err
    assert path.read_text() == "mine"
    assert drive.log.texts(LogKind.LINE) == []
    assert compax("probe", "sim://compax?name=x", "-o", str(path), "--force").code == 0
    assert DriveSettings.load(path) == DriveSettings()


def test_a_folder_that_is_not_there_is_told_before_anything_is_asked(compax: Commands, tmp_path: Path) -> None:
    drive = compax.drive("x")
    assert compax("probe", "sim://compax?name=x", "-o", str(tmp_path / "no" / "x.toml")).code == 2
    assert drive.log.texts(LogKind.LINE) == []


def test_the_report_is_one_document(compax: Commands) -> None:
    compax.drive("x", Knobs(p20=3))
    outcome = compax("probe", "sim://compax?name=x", "--json")
    document = outcome.document
    assert outcome.err == ""
    assert document["interface"] == {
        "xonxoff": True,
        "errors_suppressed": True,
        "binary": False,
        "raw": 3,
        "unknown": 0,
    }
    assert document["error_style"] == "PROMPT_ONLY"
    assert document["settings"]["verify_messages"] is True
    assert document["settings"]["message_form"] == "UNKNOWN"
    assert {each["founded"] for each in document["findings"]} <= {each.name for each in Founded}


def test_something_that_echoes_may_be_a_stepper_and_the_command_says_how_to_find_out(compax: Commands) -> None:
    async def listening() -> Any:
        return await listen("echoes", lambda: ScriptedFarEnd(lambda text: text.encode() + b"\r"))

    with compax.loop.run_until_complete(listening()):
        outcome = compax("probe", "loop://echoes")
    assert outcome.code == 6
    assert "compax smc scan loop://echoes" in outcome.told


def test_silence_ends_in_4_and_no_traceback(compax: Commands) -> None:
    compax.drive("x").silent = True
    outcome = compax("probe", "sim://compax?name=x")
    assert outcome.code == 4
    assert "powered" in outcome.told
    assert "Traceback" not in outcome.told


@pytest.mark.parametrize(
    "words", [("--baud-rate", "0"), ("--timeout", "0"), ("--timeout", "nan"), ("--baud-rate", "x")]
)
def test_options_that_mean_nothing_are_refused(compax: Commands, words: tuple[str, str]) -> None:
    drive = compax.drive("x")
    assert compax("probe", "sim://compax?name=x", *words).code == 2
    assert drive.log.texts(LogKind.LINE) == []

"""``compax replay``: a recorded conversation is shown as it went, at once or in its own time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.fakes.commands import Commands
from tests.recording.traces import rewritten, write

from compax_aio.link.contract import Lane
from compax_aio.link.taps import (
    Asked,
    Closed,
    Ended,
    Fact,
    LetGo,
    Lost,
    Noticed,
    Opened,
    Opening,
    Ready,
    Received,
    Refused,
    Resumed,
    Sent,
    Way,
)
from compax_aio.recording.trace_entries import LineMade, Missing, SessionBegun, SessionEnded

ALL_KINDS = [
    (0.0, "x", LineMade("compax")),
    (0.0, "x", Opening("serial:///dev/ttyUSB0")),
    (0.5, "x", Refused("the port is in use")),
    (1.0, "x", Opening("serial:///dev/ttyUSB0")),
    (1.0, "x", Opened()),
    (1.0, "x", Sent(b"S16\r", None, Way.MARKER)),
    (1.002, "x", Received(b"S016: 1\r\n>")),
    (1.002, "x", Noticed("InStep", ends_turn=True)),
    (1.002, "x", Ready(1)),
    (1.01, "x", Asked(1, "PA5", Lane.MOTION)),
    (1.01, "x", Sent(b"PA5\r", 1)),
    (1.02, "x", Asked(2, "S1", Lane.READ)),
    (1.02, "x", Asked(3, "STOP", Lane.STOP)),
    (2.01, "x", Ended(1, "AnswerTimeoutError", "no answer within 1 s")),
    (2.01, "x", Sent(b"STOP\r", 3, Way.AHEAD)),
    (2.02, "x", Received(b"\r\n>")),
    (2.02, "x", Noticed("LateEnding", details={"sent": "PA5"})),
    (2.03, "x", Sent(b"S1\r", 2)),
    (2.04, "x", Received(b"E17\r\n>")),
    (2.04, "x", Noticed("Rejected", ends_turn=True, details={"code": 17})),
    (2.04, "x", Ended(2, "Rejected", "E17")),
    (2.05, "x", Ended(3, "cancelled")),
    (2.06, "x", Received(b"1\r\n>")),
    (2.06, "x", Noticed("ComparatorReached", details={"number": 1})),
    (2.07, "x", Received(b"$\r\n>")),
    (2.07, "x", Noticed("PositionReached")),
    (2.08, "x", Ended(9, "Acknowledged")),
    (2.08, "x", Ended(8, "ConnectionLostError")),
    (2.1, "x", Received(b"x" * 250)),
    (2.2, "x", Resumed()),
    (3.0, "x", Lost("unplugged")),
    (3.1, "x", Ready(2)),
    (3.2, "", Missing(7)),
    (3.3, "x", LetGo()),
    (3.3, "x", Lost()),
    (3.4, "x", Closed()),
    (3.5, "", SessionBegun("now", "me", 2)),
    (3.6, "a very long name", LineMade()),
    (3.7, "", SessionEnded()),
]


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def trace(compax: Commands, tmp_path: Path) -> Path:
    """A move of a simulated drive, as the commands record it."""
    path = tmp_path / "trace.jsonl"
    assert compax("move", "sim://compax", "12.5", "--name", "x", "--trace", str(path)).code == 0
    return path


def test_a_move_is_shown_with_times_directions_and_what_it_meant(compax: Commands, trace: Path) -> None:
    outcome = compax("replay", str(trace))
    assert outcome.code == 0
    rows = outcome.out.splitlines()
    assert rows[0].split() == ["time", "after", "line", "what", "went", "over", "it"]
    (sent,) = (row for row in rows if "→ PA12.5$" in row)
    assert sent.split()[3:] == ["x", "→", "PA12.5$␍"]
    acknowledged = rows[rows.index(sent) + 1]
    assert acknowledged.split()[1:] == ["+2.0", "ms", "x", "←", "␍␊>", "acknowledged"]
    (reached,) = (row for row in rows if "position reached" in row)
    assert "← $␍␊>" in reached
    assert rows[1].endswith("compax-aio 0.1.0")
    assert rows[-1].endswith("the recording was ended")


def test_rows_fit_in_100_columns(compax: Commands, trace: Path) -> None:
    rows = compax("replay", str(trace)).out.splitlines()
    assert max(map(len, rows)) <= 100


def test_every_kind_of_entry_has_its_words(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "trace.jsonl", ALL_KINDS)
    with path.open("a") as file:
        file.write('{"at":')
    told = compax("replay", str(path)).told
    for words in (
        "· not opened: the port is in use",
        "· opening serial:///dev/ttyUSB0",
        "→ S16␍ to get in step",
        "← S016: 1␍␊> in step",
        "! STOP is asked for",
        "'no. 8' failed: ConnectionLostError:",
        "'PA5' failed: AnswerTimeoutError: no answer within 1 s",
        "→ STOP␍ ahead, although in doubt; waited 990.0 ms",
        "+990.0 ms",
        "late: answers 'PA5', whose time was over",
        "→ S1␍ waited 1.010 s",
        "← E17␍␊> rejected, E17",
        "'STOP' was given up by who had asked",
        "comparator reached 1",
        "← $␍␊> position reached",
        "… and 50 bytes",
        "a person says that nothing can happen",
        "lost: unplugged",
        "ready again",
        "7 entries are missing here",
        "let go of",
        "· ended",
        "closed for good",
        "goes on here",
        "a very long…",
        'cut off in the middle of a line: {"at":',
    ):  # fmt: skip
        assert words in told, words


def test_a_long_silence_catches_the_eye_and_hours_are_short(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "t", [(0.0, "x", LineMade()), (1.5, "x", Opened()), (5000.0, "x", Lost())])
    told = compax("replay", str(path)).told
    assert "+1.500 s x · open" in told
    assert "+4998 s x · ended" in told


def test_what_goes_out_character_by_character_is_one_row(compax: Commands, tmp_path: Path) -> None:
    steps = [
        Sent(b"A"), Received(b"A"), Sent(b"Z", None, Way.GOES_ON), Received(b"Z"), Sent(b"\n", None, Way.GOES_ON),
        Received(b" 12\n"), Noticed("Answered", ends_turn=True),
        Sent(b"B"), Received(b"B"), Noticed("Stray"), Sent(b"^", None, Way.GOES_ON),
    ]  # fmt: skip
    path = write(tmp_path / "t", [(0.0, "x", LineMade()), *((0.01, "x", fact) for fact in steps)])
    rows = [" ".join(row.split()[4:]) for row in compax("replay", str(path)).out.splitlines()[3:]]
    assert rows == ["→ AZ␊", "← 12␊ answered", "→ B", "← B stray", "→ ^"]


def test_only_a_part_is_shown_if_that_is_wanted(compax: Commands, tmp_path: Path) -> None:
    entries: list[tuple[float, str, Fact]] = [(0.0, "x", LineMade()), (0.0, "y", LineMade())]
    entries += [(float(at), line, Received(f"{line}{at}".encode())) for at in range(1, 6) for line in "xy"]
    path = write(tmp_path / "t", entries)
    path.write_text(path.read_text() * 2)

    def shown(*options: str) -> list[str]:
        rows = compax("replay", str(path), *options).out.splitlines()
        return [row.split("← ")[1] for row in rows if "←" in row]

    assert len(shown()) == 20
    assert shown("--line", "y", "--session", "2", "--from", "2", "--until", "3.5") == ["y2", "y3"]
    assert shown("--line", "x", "--line", "y", "--session", "1", "--until", "1") == ["x1", "y1"]


def test_it_can_be_shown_in_its_own_time(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "t", [(0.0, "x", LineMade()), (10.0, "x", Opened()), (70.0, "x", Lost())])
    path.write_text(path.read_text() * 2)
    begun_at = compax.loop.time()
    assert compax("replay", str(path), "--speed", "2").code == 0
    assert compax.loop.time() - begun_at == 70
    begun_at = compax.loop.time()
    compax("replay", str(path), "--speed", "1", "--session", "1", "--from", "10")
    assert compax.loop.time() - begun_at == 60


def test_json_has_every_entry_with_its_place(compax: Commands, trace: Path) -> None:
    documents = compax("replay", str(trace), "--json").documents
    lines = trace.read_text().splitlines()
    assert [each["place"] for each in documents] == list(range(1, len(lines) + 1))
    (sent,) = (each for each in documents if each.get("data") == "PA12.5$\r")
    assert (sent["what"], sent["way"], sent["line"]) == ("Sent", "TURN", "x")
    assert json.loads(lines[sent["place"] - 1])["data"] == "PA12.5$\r"


@pytest.mark.parametrize(
    ("content", "options", "why"),
    [
        (None, (), "cannot be read: No such file"),
        ("answer_timeout_s = 1\n", (), "is no trace, or is damaged, in line 1"),
        ("", ("--until", "1", "--from", "2"), "--until 1 is before --from 2"),
        ("", ("--line", "z"), "the trace has no line 'z'; it has none"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    compax: Commands, tmp_path: Path, content: str | None, options: tuple[str, ...], why: str
) -> None:
    path = tmp_path / "t"
    if content is not None:
        path.write_text(content)
    outcome = compax("replay", str(path), *options)
    assert outcome.code == 2
    assert why in outcome.told


def test_an_empty_trace_says_so(compax: Commands, tmp_path: Path) -> None:
    path = tmp_path / "t"
    path.touch()
    assert "Nothing is recorded there" in compax("replay", str(path)).told


def test_names_and_texts_of_others_forge_nothing(compax: Commands, tmp_path: Path) -> None:
    evil = "\x1b[2J\n"
    path = write(
        tmp_path / "t",
        [
            (0.0, evil, LineMade(evil)),
            (0.0, evil, Opening(evil)),
            (0.1, evil, Refused(evil)),
            (0.2, evil, Noticed(evil, details={"sent": evil})),
            (0.3, evil, Received(evil.encode())),
            (0.4, evil, Ended(1, f"{evil}Error", evil)),
        ],
    )
    rewritten(path, lambda entries: entries[0].update(begun=evil, by=evil))
    out = compax("replay", str(path)).out
    assert "\x1b" not in out
    assert len(out.splitlines()) == 8


def test_details_and_shares_of_others_forge_nothing_either(compax: Commands, tmp_path: Path) -> None:
    evil = "\x1b[2J\n"
    names = ["Rejected", "ComparatorReached", "LateEnding"]
    details = {"code": evil, "number": {evil: evil}, "sent": [evil] * 50}
    path = write(tmp_path / "t", [(0.1 * at, "x", Noticed(name, details=details)) for at, name in enumerate(names)])
    out = compax("replay", str(path)).out
    assert "\x1b" not in out
    assert len(out.splitlines()) == 5
    assert max(map(len, out.splitlines())) < 200


def test_json_of_others_is_one_line_each_that_no_terminal_heeds(compax: Commands, tmp_path: Path) -> None:
    odd = "\x9b2J\x7f\u2028\u202e\udc80"
    path = write(tmp_path / "t", [(0.0, odd, Received(b"\x9b2J")), (0.0, odd, Noticed(odd, details={odd: odd}))])
    outcome = compax("replay", str(path), "--json")
    assert [each["line"] for each in outcome.documents] == ["", odd, odd]
    assert outcome.documents[1]["data"] == "\x9b2J"
    assert all(line.isprintable() for line in outcome.out.split("\n"))


def test_a_session_that_goes_on_in_another_file_goes_on_in_its_own_time(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "t", [(0.0, "x", LineMade()), (3600.0, "x", Opened())])
    path.rename(tmp_path / "t.1")
    rewritten(
        write(path, [(0.0, "x", LineMade(is_open=True)), (3601.0, "x", Received(b"1"))]),
        lambda entries: entries[0].update(part=2),
    )
    begun_at = compax.loop.time()
    assert compax("replay", str(path), "--speed", "1", "--from", "3600").code == 0
    assert compax.loop.time() - begun_at == 1
    (tmp_path / "t.1").unlink()
    begun_at = compax.loop.time()
    assert compax("replay", str(path), "--speed", "1").code == 0
    assert compax.loop.time() == begun_at


def test_a_session_that_is_not_there_is_told(compax: Commands, tmp_path: Path) -> None:
    outcome = compax("replay", str(write(tmp_path / "t", [])), "--session", "2")
    assert outcome.code == 2
    assert "the trace has no session 2; it has 1" in outcome.told


def test_what_never_ends_is_shown_in_little_memory(compax: Commands, tmp_path: Path) -> None:
    steps: list[Fact] = []
    for at in range(3000):
        steps += [Asked(at, "S1", Lane.READ), Sent(b"a", None, Way.GOES_ON), Received(b"a")]
    steps += [Noticed("Stray")] * 100
    path = write(tmp_path / "t", [(0.0, "x", step) for step in steps])
    rows = compax("replay", str(path)).out.splitlines()
    assert max(map(len, rows)) < 1500
    assert sum(row.count("stray") for row in rows) == 100
    assert sum(row.count("a" * 500) for row in rows) >= 2

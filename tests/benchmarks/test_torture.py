"""The torture is one: what people write by hand shifts answers, compax_aio does not; and the page says what is so."""

from __future__ import annotations

import asyncio
import json
import logging
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from benchmarks.torture import DETAILS_HEAD, OVERVIEW_HEAD, Result, main, measure, table
from benchmarks.torture_conversations import LATE_S, NAMED, TIMEOUT_S, UNNAMED, Conversation, Outcome, Questions, Write
from benchmarks.torture_far_end import WORK_S, CompaxLines, Endpoint, FarEnd, ModbusRtu, ModbusTcp, on_tcp
from benchmarks.torture_peers import PEERS, Client, Peer

from compax_aio.simulator.clock import VirtualClockLoop

PAGE = Path(__file__).parents[2] / "docs" / "torture.md"
ROOT = PAGE.parents[1]


def peer(name: str) -> Peer:
    return next(each for each in PEERS if each.name == name)


def verdicts(result: Result) -> list[str]:
    return [each.verdict for each in result.found.values() if isinstance(each, Conversation)]


def table_of_the_page(head: Sequence[str]) -> list[list[str]]:
    """Give the rows below the one table that has *head*."""
    tables = re.findall(r"(?:^\|.*\n)+", PAGE.read_text(), re.MULTILINE)
    cells = [[[cell.strip() for cell in line.strip("|").split("|")] for line in each.splitlines()] for each in tables]
    (rows,) = [rows for first, _, *rows in cells if first == list(head)]
    return rows


async def test_with_compax_aio_everybody_gets_his_own_answer() -> None:
    ours = await measure(peer("compax_aio"))
    assert verdicts(ours) == ["right"] * 4
    assert ours.details()[2:] == ["AnswerTimeoutError", "its own", "its own", "right"]


async def test_compax_aio_tells_of_a_command_that_was_accepted_late() -> None:
    ours = await measure(peer("compax_aio"))
    late = ours.found["late_unnamed"]
    assert isinstance(late, Conversation)
    assert [each.answer for each in late.outcomes] == ["", "E90", ""]


async def test_compax_aio_sends_a_motion_once_though_nobody_answers() -> None:
    ours = await measure(peer("compax_aio"))
    assert ours.found["unanswered"] == Write(1, "AnswerTimeoutError")


async def test_streams_a_lock_and_a_time_out_shift_every_answer() -> None:
    by_hand = await measure(peer("asyncio streams"))
    assert verdicts(by_hand) == ["shifted"] * 4
    assert by_hand.details()[2:] == ["TimeoutError", "answer to A", "answer to B", "shifted"]


async def test_throwing_away_what_has_come_helps_only_against_what_has_come() -> None:
    discarding = await measure(peer("asyncio streams, discarding before asking"))
    assert verdicts(discarding) == ["shifted", "right", "shifted", "shifted"]


async def test_a_line_that_is_opened_anew_helps_only_where_the_far_end_forgets() -> None:
    assert verdicts(await measure(peer("asyncio streams, opened anew"))) == ["shifted", "right", "shifted", "shifted"]
    assert verdicts(await measure(peer("asyncio streams, opened anew, far end forgets"))) == ["right"] * 4


# Verdicts -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("questions", "got", "told", "verdict"),
    [
        (NAMED, (None, "S003: 202.00", "303"), ["TimeoutError", "its own", "its own"], "right"),
        (NAMED, ("101", "202", "303"), ["its own", "its own", "its own"], "right"),
        (NAMED, (None, "S001: 101.00", "202"), ["TimeoutError", "answer to A", "answer to B"], "shifted"),
        (NAMED, (None, None, "303"), ["TimeoutError", "TimeoutError", "its own"], "error"),
        (NAMED, (None, "", "303"), ["TimeoutError", "nobody's: ''", "its own"], "shifted"),
        (UNNAMED, ("", "E90", ""), ["its own", "its own", "its own"], "right"),
        (UNNAMED, (None, "", "E90"), ["TimeoutError", "answer to A", "answer to B"], "shifted"),
    ],
)
def test_who_got_whose_answer_is_told_and_judged(
    questions: Questions, got: tuple[str | None, ...], told: list[str], verdict: str
) -> None:
    outcomes = [
        Outcome(question, answer=text, error="TimeoutError" if text is None else None)
        for question, text in zip(questions, got, strict=True)
    ]
    conversation = Conversation(questions, tuple(outcomes))
    assert conversation.told() == told
    assert conversation.verdict == verdict


async def test_a_peer_that_is_not_installed_is_named() -> None:
    result = await measure(Peer(name="nobody", packages=("no-such-package",), open=peer("compax_aio").open))
    assert result.details() == ["nobody", "not installed", "", "", "", ""]
    assert result.overview() == ["nobody", *["not installed"] * 5]


async def test_a_peer_that_cannot_be_opened_does_not_end_the_run() -> None:
    async def refuse(where: Endpoint, timeout_s: float) -> Client:
        raise ConnectionRefusedError

    result = await measure(Peer(name="refused", open=refuse))
    assert result.overview() == ["refused", *["failed: ConnectionRefusedError"] * 5]


async def test_a_peer_that_never_comes_back_is_called_hung() -> None:
    class Sleeper:
        async def ask(self, question: object) -> str:
            await asyncio.sleep(1e6)
            return ""

        async def close(self) -> None:
            pass

    async def open_it(where: Endpoint, timeout_s: float) -> Client:
        return Sleeper()

    result = await measure(Peer(name="sleeper", open=open_it))
    assert result.details() == ["sleeper", result.version, "hung", "hung", "hung", "error"]


# The far end --------------------------------------------------------------------------------------------------------


async def test_the_far_end_works_in_order_and_takes_its_time() -> None:
    far_end = FarEnd(CompaxLines(), NAMED)
    far_end.slow["A"] = 1.0
    async with on_tcp(far_end) as where:
        reader, writer = await asyncio.open_connection("127.0.0.1", where.tcp_port)
        writer.write(b"S1\rS3\r")
        loop = asyncio.get_running_loop()
        begun_at = loop.time()
        assert await reader.readuntil(b">") == b"S001: 101.00\r\n>"
        assert loop.time() - begun_at == pytest.approx(1.0)
        assert await reader.readuntil(b">") == b"S003: 202.00\r\n>"
        assert loop.time() - begun_at == pytest.approx(1.0 + WORK_S)
        writer.close()


@pytest.mark.parametrize("forgets_closed", [False, True])
async def test_an_answer_whose_connection_is_closed_goes_to_the_next_or_nowhere(forgets_closed: bool) -> None:
    far_end = FarEnd(CompaxLines(), NAMED, forgets_closed=forgets_closed)
    far_end.slow["A"] = 1.0
    async with on_tcp(far_end) as where:
        _, writer = await asyncio.open_connection("127.0.0.1", where.tcp_port)
        writer.write(b"S1\r")
        await asyncio.sleep(0.1)
        writer.close()
        reader, writer = await asyncio.open_connection("127.0.0.1", where.tcp_port)
        writer.write(b"S3\r")
        first = await reader.readuntil(b">")
        assert first == (b"S003: 202.00\r\n>" if forgets_closed else b"S001: 101.00\r\n>")
        writer.close()


def test_modbus_frames_are_as_the_standard_has_them() -> None:
    read, write = bytes.fromhex("010300010001D5CA"), bytes.fromhex("010600010003980B")
    assert list(ModbusRtu().requests(bytearray(read + write[:-1]))) == [read]
    assert ModbusRtu().answer(read, None) == bytes.fromhex("0103020000B844")
    assert ModbusRtu().answer(write, None) == write
    with_number = bytes.fromhex("0007 0000 0006 01 03 0001 0001")
    assert ModbusTcp().answer(with_number, NAMED[0]) == bytes.fromhex("0007 0000 0005 01 03 02 0065")


# What is printed and told -------------------------------------------------------------------------------------------


@pytest.fixture
def logging_as_before() -> Iterator[None]:
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.usefixtures("logging_as_before")
def test_the_program_prints_two_tables_and_writes_all_it_knows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        monkeypatch.setattr(asyncio, "run", runner.run)
        assert main(["--only", "compax_aio", "--json", str(tmp_path / "found.json")]) == 0
    printed = capsys.readouterr().out
    assert re.search(
        r"^\| compax_aio \| \S+ +\| AnswerTimeoutError \| its own \| its own \| right", printed, re.MULTILINE
    )
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["timeout_s"] < found["late_s"] < 2 * found["timeout_s"]
    (ours,) = found["peers"]
    assert ours["trials"]["late"]["got"] == {"A": "AnswerTimeoutError", "B": "its own", "C": "its own"}
    assert ours["trials"]["cancelled"]["got"] == {"B": "its own", "C": "its own"}
    assert ours["trials"]["unanswered"] == {"frames": 1, "told": "AnswerTimeoutError"}


def test_a_table_reads_as_text_and_as_markdown() -> None:
    assert table(("peer", "x"), [("a", "right")]) == "| peer | x     |\n|------|-------|\n| a    | right |"


def test_the_page_shows_every_peer_and_nothing_else() -> None:
    for head in (DETAILS_HEAD, OVERVIEW_HEAD):
        rows = table_of_the_page(head)
        assert [row[0] for row in rows] == [each.name for each in PEERS]
        assert {len(row) for row in rows} == {len(head)}
    assert "not installed" not in str(table_of_the_page(DETAILS_HEAD))


def test_both_tables_of_the_page_are_of_one_run() -> None:
    assert [row[5] for row in table_of_the_page(DETAILS_HEAD)] == [row[1] for row in table_of_the_page(OVERVIEW_HEAD)]


def test_what_a_peer_cannot_take_part_in_is_told_on_the_page() -> None:
    for each, row in zip(PEERS, table_of_the_page(OVERVIEW_HEAD), strict=True):
        assert (row[3] == "n.a.") == (not each.is_on_lines)
        assert (row[4] == "blocks") == each.blocks


@pytest.mark.parametrize("name", ["compax_aio", *(each.name for each in PEERS if not each.packages)])
async def test_the_page_says_what_is_measured(name: str) -> None:
    result = await measure(peer(name))
    assert [row[2:] for row in table_of_the_page(DETAILS_HEAD) if row[0] == name] == [list(result.details())[2:]]
    assert [row for row in table_of_the_page(OVERVIEW_HEAD) if row[0] == name] == [list(result.overview())]


def test_the_page_gives_the_times_that_are_used() -> None:
    page = PAGE.read_text()
    assert f"Question A is answered {LATE_S:g} s after it was asked, B and C {WORK_S:g} s after." in page
    assert f"The time-out is {TIMEOUT_S:g} s" in page


def test_every_package_of_a_peer_is_installed_by_the_group_of_benchmarks() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    (group,) = re.findall(r"^benchmarks = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    installed = {name.lower() for name in re.findall(r'"([\w-]+)', group)} | {"compax-aio", "pyserial"}
    assert {package.lower() for each in PEERS for package in each.packages} <= installed


def test_no_module_of_the_library_knows_the_peers() -> None:
    """The GPL of sockio stays with the benchmark."""
    imports = re.compile(r"^\s*(?:from|import) (sockio|benchmarks)\b", re.MULTILINE)
    assert not [path for path in (ROOT / "src").glob("**/*.py") if imports.search(path.read_text())]

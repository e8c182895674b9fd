"""A far end in a process of its own says where it is, answers questions, and ends with the block."""

from __future__ import annotations

import os
import socket
import textwrap
import time
from pathlib import Path

import pytest
from benchmarks.far_ends.canned import HOST, POSITION, answer
from benchmarks.measuring import FarEnd, far_end

pytestmark = pytest.mark.real_time


def _has_ended(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def _ask(far: FarEnd, line: bytes) -> bytes:
    with socket.create_connection((HOST, far.where["tcp"])) as connection:
        connection.settimeout(10)
        for piece in (line[:1], line[1:]):
            connection.sendall(piece)
        come = b""
        while not come.endswith(b">"):
            come += connection.recv(64)
        return come


def test_the_canned_drive_answers_on_tcp_and_on_terminals_and_tells_its_cpu_time() -> None:
    with far_end("benchmarks.far_ends.canned", "2") as far:
        assert len(set(far.where["pty"])) == 2
        assert _ask(far, b"S1\r") == b"S001: %.2f\r\n>" % POSITION
        for path in far.where["pty"]:
            terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
            os.write(terminal, b"S1\r")
            assert os.read(terminal, 64) == b"S001: %.2f\r\n>" % POSITION
            os.close(terminal)
        assert 0 < far.cpu_s < 60
        pid = far.pid
    assert _has_ended(pid)


def test_a_far_end_ends_when_what_is_measured_fails() -> None:
    pids = []

    def fail() -> None:
        with far_end("benchmarks.far_ends.canned", "0") as far:
            pids.append(far.pid)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert all(map(_has_ended, pids))
    assert pids


def _module(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> str:
    (folder / "far_end_of_this_test.py").write_text(textwrap.dedent(text))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(Path.cwd())]))
    return "far_end_of_this_test"


def test_a_far_end_that_ends_at_once_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = _module(tmp_path, monkeypatch, "raise SystemExit(3)")
    with pytest.raises(RuntimeError, match="ended at once"), far_end(module):
        pass


def test_a_far_end_that_does_not_end_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.measuring.far_end_process._GRACE_S", 0.05)
    module = _module(tmp_path, monkeypatch, "import time; print('{}', flush=True); time.sleep(60)")
    begun_at = time.monotonic()
    with far_end(module) as far:
        pid = far.pid
    assert _has_ended(pid)
    assert time.monotonic() - begun_at < 50, "it has ended by itself"


def test_a_far_end_answers_questions_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = _module(
        tmp_path,
        monkeypatch,
        """
        import asyncio
        from benchmarks.measuring import stay
        asyncio.run(stay([1, 2], {"twice": lambda rest: 2 * rest}))
        """,
    )
    with far_end(module) as far:
        assert far.where == [1, 2]
        assert far.ask("twice ab") == "abab"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"S1", b"S001: 120.50\r\n>"),
        (b"S99", b"S099: 0.00\r\n>"),
        (b"POSA 5", b"\r\n>"),
        (b"P20", b"P020: 0\r\n>"),
    ],
)
def test_the_canned_drive_says_what_a_drive_at_rest_says(line: bytes, said: bytes) -> None:
    assert answer(line) == said

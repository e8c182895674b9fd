"""The nightly backup keeps, verifies and compares what simulated controls send, and ends as it promises."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.examples.test_examples import load

from compax_aio.haas.archive import Archive
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.haas import Knobs, SimulatedControl
from compax_aio.simulator.server import control_named

URL = "sim://haas?name="


class Shop:
    """Controls whose keys press themselves, on one virtual clock."""

    def __init__(self, example: Any, folder: Path) -> None:
        self.example = example
        self.folder = folder
        self.loop = VirtualClockLoop()
        self.interrupted_after_s: float | None = None

    def control(self, name: str, **knobs: Any) -> SimulatedControl:
        async def make() -> SimulatedControl:
            usual = {"profile": "dc codes", "baudrate": 9600, "press": self.example.PRESSES, "press_after_s": 3.0}
            return control_named(name, Knobs(**{**usual, "press_again": True, **knobs}))

        return self.loop.run_until_complete(make())

    def night(self, *words: str) -> int:
        code: int = self.example.main([*words, "--folder", str(self.folder), "--operator-timeout", "60"])
        return code


@pytest.fixture
def shop(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Shop]:
    shop = Shop(load("haas_nightly_backup"), tmp_path / "backups")

    def run(work: Coroutine[Any, Any, Any]) -> Any:
        task = shop.loop.create_task(work)
        if shop.interrupted_after_s is not None:
            shop.loop.call_later(shop.interrupted_after_s, task.cancel)
        try:
            return shop.loop.run_until_complete(task)
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(asyncio, "run", run)
    yield shop
    shop.loop.close()


def test_all_is_kept_twice_equal_and_the_second_night_finds_no_change(
    shop: Shop, capsys: pytest.CaptureFixture[str]
) -> None:
    shop.control("mill")
    assert shop.night(f"mill={URL}mill") == 0
    told = capsys.readouterr().out
    assert "mill: at the control, choose ALL programs and press SEND\n" in told
    assert "mill: 5 of 5 files kept" in told
    assert told.count("byte for byte") == 5
    assert shop.night(f"mill={URL}mill") == 0
    first, second = sorted(shop.folder.iterdir())
    for kind in shop.example.KINDS:
        one, other = (each / "mill" / f"{kind}.txt" for each in (first, second))
        assert one.read_bytes() == other.read_bytes() != b""


def test_what_has_changed_since_is_told(shop: Shop, capsys: pytest.CaptureFixture[str]) -> None:
    control = shop.control("mill")
    shop.night(f"mill={URL}mill")
    control.memory.offsets[3] = "0.5000"
    control.memory.programs["O00077"] = "O00077\nM30"
    control.memory.parameters.update(dict.fromkeys(range(1, 40), "7"))
    capsys.readouterr()
    assert shop.night(f"mill={URL}mill") == 3
    told = capsys.readouterr().out
    assert "changed  offsets: N3: 0.0375 became 0.5000" in told
    assert "changed  programs: O00077: 'O00077' is new" in told
    assert "changed  parameters: and 29 more" in told


def test_what_is_missing_of_one_control_harms_no_other(shop: Shop, capsys: pytest.CaptureFixture[str]) -> None:
    shop.control("mill")
    shop.control("lathe", press="send:ALL,send:ALL")
    assert shop.night(f"mill={URL}mill", f"lathe={URL}lathe", "saw=sim://nothing") == 1
    told, missing = capsys.readouterr()
    assert "mill: 5 of 5 files kept" in told
    assert "lathe: 1 of 5 files kept" in told
    assert "saw: 0 of 5 files kept" in told
    assert "saw: missing: programs: there is no simulated 'nothing'" in missing
    assert [each.name for each in shop.folder.glob("*/lathe/*.txt")] == ["programs.txt"]


def test_ctrl_c_keeps_what_is_whole(shop: Shop, capsys: pytest.CaptureFixture[str]) -> None:
    shop.control("mill")
    shop.interrupted_after_s = 20.0
    assert shop.night(f"mill={URL}mill") == 130
    assert "what is whole is kept" in capsys.readouterr().err
    assert list(shop.folder.glob("*/mill/programs.txt"))
    assert not list(shop.folder.glob("*/mill/macros.txt"))


@pytest.mark.parametrize(
    "words", [("mill",), ("mill=sim://haas", "mill=sim://haas"), ("a b=sim://haas", "c=sim://haas")]
)
def test_what_names_no_control_is_refused(
    shop: Shop, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert shop.night(*words) == 1
    assert "is no NAME=URL" in capsys.readouterr().err
    assert not shop.folder.exists()


def test_a_file_that_cannot_be_kept_harms_no_other_one(
    shop: Shop, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    append = Archive._append

    def no_room(self: Archive, data: bytes) -> None:
        if "settings" in str(self.place):
            raise OSError(errno.ENOSPC, "No space left on device")
        append(self, data)

    monkeypatch.setattr(Archive, "_append", no_room)
    shop.control("full")
    assert shop.night(f"full={URL}full") == shop.example.MISSING
    captured = capsys.readouterr()
    assert "full: 4 of 5 files kept" in captured.out
    assert "missing: settings: the settings came, but could not be written to the archive" in captured.err


def test_what_cannot_be_compared_is_kept_and_told_as_changed(shop: Shop, capsys: pytest.CaptureFixture[str]) -> None:
    shop.control("older")
    assert shop.night(f"older={URL}older") == 0
    (file,) = shop.folder.glob("*/older/offsets.txt")
    file.write_text("this is no file of a control\n")
    shop.control("older2")
    capsys.readouterr()
    assert shop.night(f"older={URL}older2") == shop.example.CHANGED
    assert "5 of 5 files kept" in (text := capsys.readouterr().out)
    assert "changed  offsets: cannot be compared with" in text

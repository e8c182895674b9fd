"""``compax info``: who a drive is; what it refuses to say is told, and ends nothing."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.fakes.commands import Commands
from tests.fakes.scripted import ScriptedFarEnd

from compax_aio.simulator.compax import Knobs, LogKind
from compax_aio.transports.loopback import listen


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


def test_it_says_who_the_drive_is_and_moves_nothing(compax: Commands) -> None:
    drive = compax.drive("x", Knobs(p20=16 + 8, travel_min=-10, travel_max=500))
    outcome = compax("info", "sim://compax?name=x")
    assert outcome.code == 0
    told = outcome.told
    assert "S31 'SIMULATOR 1'" in told
    assert "P20 = 24" in told
    assert "binary: yes" in told
    assert "bits of unknown meaning: 8 together" in told
    assert "travel: -10 to 500 units" in told
    assert "temperature of the power stage: 35 °C (S6)" in told
    assert "empty (S18)" in told
    assert "(median)" in told
    lines = drive.log.texts(LogKind.LINE)
    assert all(line[0] in "SP" and line[1:].isdigit() for line in lines), lines


def test_errors_of_the_past_are_told_with_their_meaning_and_end(compax: Commands) -> None:
    drive = compax.drive("x")

    def trouble() -> None:
        drive.raise_fault(55)
        drive.receive(b"QUIT\r", compax.loop.time())
        drive.advance(compax.loop.time() + 0.01)
        drive.raise_fault(53)

    compax.after(0.0, trouble)
    told = compax("info", "sim://compax?name=x").told
    assert "E53: overload of motor or unit; reduce load" in told
    assert "E53: overload of motor or unit, not acknowledged" in told
    assert "E55: emergency stop, ended by acknowledged" in told


def test_json_has_it_all(compax: Commands) -> None:
    compax.drive("x")
    document = compax("info", "sim://compax?name=x", "--json").document
    assert document["identification"]["S39"].startswith("SIMULATOR")
    assert document["axis"]["unit_code"] == 1.0
    assert document["interface"]["raw"] == 0
    assert document["unit_of_values"]["S8"]["value"] == 320.0
    assert document["line"]["timeouts"] == 0
    assert document["line"]["median_answer_s"] > 0
    assert document["error_history"] == []


def test_what_the_drive_refuses_is_told_and_ends_nothing(compax: Commands) -> None:
    def script(text: str) -> bytes:
        if text in {"S16", "S17", "S30"}:
            return f"S{int(text[1:]):03d}: 00000000\r\n>".encode() if text != "S30" else b"E91\r\n>"
        return b"E90\r\n>"

    async def listening() -> object:
        return await listen("refuses", lambda: ScriptedFarEnd(script))

    with compax.loop.run_until_complete(listening()):  # type: ignore[attr-defined]
        outcome = compax("info", "loop://refuses")
    assert outcome.code == 0
    for name in ("S31", "S6", "axis", "P20", "error", "error_history"):
        assert f"{name} was not said: the drive rejected it with E9" in outcome.told, name
    assert outcome.told.count("not given") == 5


def test_a_drive_that_says_nothing_is_no_drive(compax: Commands) -> None:
    compax.drive("x").silent = True
    outcome = compax("info", "sim://compax?name=x")
    assert outcome.code == 4
    assert "check power, cable" in outcome.told

"""What simulated devices have done is kept in order, told to who wants to know, and forgotten from the oldest on."""

from __future__ import annotations

from enum import StrEnum

import pytest

from compax_aio.simulator import camm1, compax, haas, smc
from compax_aio.simulator.log import DeviceLog, DeviceLogEntry
from compax_aio.simulator.surroundings import DeviceSurroundings


class Kind(StrEnum):
    CAME = "came"
    LOST = "lost"


class Entry(DeviceLogEntry[Kind]):
    __slots__ = ()


@pytest.fixture
def log() -> DeviceLog[Entry, Kind]:
    return DeviceLog(Entry, 3)


def test_the_oldest_entries_fall_off(log: DeviceLog[Entry, Kind]) -> None:
    for at in range(5):
        log.add(at, Kind.CAME, f"{at}")
    assert log.texts(Kind.CAME) == ["2", "3", "4"]
    assert log.texts(Kind.LOST) == []


def test_who_wants_to_know_is_told_of_each_entry(log: DeviceLog[Entry, Kind]) -> None:
    told: list[Entry] = []
    log.on_entry = told.append
    log.add(1.0, Kind.CAME)
    log.add_count(2.0, Kind.LOST, 7)
    assert told == [Entry(1.0, Kind.CAME, ""), Entry(2.0, Kind.LOST, "7")]


def test_a_count_is_one_entry_until_something_else_is_noted(log: DeviceLog[Entry, Kind]) -> None:
    log.add_count(1.0, Kind.LOST, 1)
    log.add_count(2.0, Kind.LOST, 2)
    assert list(log) == [Entry(2.0, Kind.LOST, "2")]
    log.add(3.0, Kind.CAME, "x")
    log.add_count(4.0, Kind.LOST, 3)
    assert log.texts(*Kind) == ["2", "x", "3"]


def test_parts_of_a_device_note_at_its_time_or_at_one_of_their_own(log: DeviceLog[Entry, Kind]) -> None:
    around = DeviceSurroundings(None, log)
    around.reach(5.0)
    around.reach(4.0)
    around.note(Kind.CAME, "now")
    around.note(Kind.CAME, "before", 3.0)
    around.note_count(Kind.LOST, 1)
    assert [(entry.at, entry.text) for entry in log] == [(5.0, "now"), (3.0, "before"), (5.0, "1")]


def test_an_entry_tells_of_what_kind_of_device_it_is() -> None:
    entries = {compax.LogEntry, smc.LogEntry, camm1.LogEntry, haas.LogEntry}
    devices = (compax.SimulatedDrive(), smc.SimulatedPartyLine(), camm1.SimulatedCutter(), haas.SimulatedControl())
    for device in devices:
        device.connect(0.0)
    assert {type(device.log[-1]) for device in devices} == entries

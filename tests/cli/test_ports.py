"""``compax ports``: each port with the URL that opens it, and what to do where there is none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.fakes.commands import Commands

from compax_aio.cli import ports
from compax_aio.transports.serial import PortInfo


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


def there_are(monkeypatch: pytest.MonkeyPatch, *infos: PortInfo) -> None:
    async def list_ports() -> list[PortInfo]:
        return list(infos)

    monkeypatch.setattr(ports, "list_ports", list_ports)


def adapter(device: str, serial_number: str | None) -> PortInfo:
    return PortInfo(device=device, description="USB [red]UART", manufacturer="FTDI", serial_number=serial_number)


def test_each_port_is_listed_with_the_url_that_opens_it(compax: Commands, monkeypatch: pytest.MonkeyPatch) -> None:
    there_are(monkeypatch, adapter("/dev/ttyUSB0", "A1"), adapter("/dev/ttyUSB1", None))
    outcome = compax("ports")
    assert outcome.code == 0
    assert "serial:///dev/ttyUSB0" in outcome.out
    assert "serial://?serial_number=A1" in outcome.out
    assert "USB [red]UART" in outcome.out, "what a device says is no markup"
    assert "compax probe" in outcome.err


def test_ports_that_share_a_serial_number_are_not_named_by_it(
    compax: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    there_are(monkeypatch, adapter("/dev/ttyUSB0", "A 1"), adapter("/dev/ttyUSB1", "A 1"), adapter("COM3", "B/2"))
    documents = compax("ports", "--json").document
    assert [each["url_by_serial_number"] for each in documents] == [None, None, "serial://?serial_number=B/2"]
    assert documents[2]["url"] == "serial://COM3"
    assert documents[0]["serial_number"] == "A 1"


def test_no_port_is_no_error_and_says_what_else_there_is(compax: Commands, monkeypatch: pytest.MonkeyPatch) -> None:
    there_are(monkeypatch)
    outcome = compax("ports")
    assert outcome.code == 0
    assert outcome.out == ""
    assert "plugged in" in outcome.err
    assert compax("ports", "--json").document == []

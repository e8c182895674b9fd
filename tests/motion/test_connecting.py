"""Anything that can be opened and closed is connected to in the same way."""

from __future__ import annotations

import pytest

from compax_aio.errors import TransportError
from compax_aio.motion.connecting import Connecting, name_of

URL = "tcp://host:4001?keepalive=1"


class Device:
    def __init__(self) -> None:
        self.calls: list[str] = []

    async def _open(self, url: str) -> None:
        self.calls.append(f"open {url}")

    async def close(self) -> None:
        self.calls.append("close")


async def test_awaiting_gives_it_open() -> None:
    assert (await Connecting(URL, Device)).calls == [f"open {URL}"]


async def test_leaving_the_block_closes_it_however_it_ends() -> None:
    inside: list[Device] = []

    async def fail() -> None:
        async with Connecting(URL, Device) as device:
            inside.append(device)
            assert device.calls == [f"open {URL}"]
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()
    assert inside[0].calls == [f"open {URL}", "close"]


async def test_what_cannot_be_opened_is_not_closed_by_whoever_never_got_it() -> None:
    made: list[Device] = []

    class Dead(Device):
        async def _open(self, url: str) -> None:
            made.append(self)
            raise TransportError(f"{url} cannot be opened")

    with pytest.raises(TransportError):
        async with Connecting(URL, Dead):
            pytest.fail("nobody gets in")
    assert made[0].calls == []


def test_nothing_is_made_before_somebody_waits() -> None:
    Connecting(URL, lambda: pytest.fail("too early"))


@pytest.mark.parametrize(
    ("url", "name", "shown"),
    [
        (URL, None, "tcp://host:4001"),
        (URL, "x", "x"),
        ("serial://?serial_number=A5", None, "serial://?serial_number=A5"),
        ("no url", "line\n1", r"line\n1"),
    ],
)
def test_its_name_is_the_one_given_or_what_names_the_line(url: str, name: str | None, shown: str) -> None:
    assert name_of(url, name) == shown


def test_without_a_name_the_url_must_be_one() -> None:
    with pytest.raises(TransportError):
        name_of("no url", None)

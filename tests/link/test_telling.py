"""Telling taps what happens on a line: those who listened when it was made, each until it has heard enough."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import pytest

import compax_aio
from compax_aio.link.taps import TAPS, Closed, Ended, Fact, LetGo, LineTap, Opened
from compax_aio.link.telling import Telling
from compax_aio.recording import record_trace


class Ear:
    """Hears so many facts, and then no more."""

    def __init__(self, enough: int) -> None:
        self.heard: list[Fact] = []
        self.names: list[str] = []
        self._enough = enough

    def line(self, name: str, about: Mapping[str, object]) -> LineTap:
        self.names.append(f"{name} {about}")
        return self.hear

    def hear(self, fact: Fact) -> bool:
        if len(self.heard) < self._enough:
            self.heard.append(fact)
        return len(self.heard) < self._enough


@pytest.fixture
def listening() -> Iterator[Callable[..., None]]:
    token = TAPS.set(())
    yield lambda *ears: TAPS.set(tuple(ear.line for ear in ears)) and None
    TAPS.reset(token)


def test_nobody_is_told_and_nothing_is_asked_where_nobody_listens() -> None:
    def about() -> Mapping[str, object]:
        pytest.fail("nobody wants to know")

    telling = Telling("x", about)
    assert not telling.is_heard
    telling.tell(Opened())


def test_each_is_told_until_it_has_heard_enough(listening: Callable[..., None]) -> None:
    short, long = Ear(1), Ear(3)
    listening(short, long)
    telling = Telling("x", lambda: {"device": "compax"})
    assert short.names == long.names == ["x {'device': 'compax'}"]
    for fact in (Opened(), LetGo(), Closed(), Opened()):
        telling.tell(fact)
    assert short.heard == [Opened()]
    assert long.heard == [Opened(), LetGo(), Closed()]
    assert not telling.is_heard


async def test_whoever_says_nothing_goes_on_listening(listening: Callable[..., None]) -> None:
    told: list[Fact] = []
    TAPS.set((lambda _name, _about: told.append,))
    async with compax_aio.connect("sim://compax", name="x") as x:
        await x.position()
    assert any(isinstance(fact, Ended) for fact in told)
    assert Closed() in told


async def test_a_line_that_outlives_its_recording_costs_nothing_more(tmp_path: object) -> None:
    async with record_trace(f"{tmp_path}/trace.jsonl"):
        x = await compax_aio.connect("sim://compax", name="x")
    assert await x.position() == 0
    assert not x._line.link._telling.is_heard
    await x.close()

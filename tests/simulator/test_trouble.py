"""Trouble befalls replies when a test says so, or by chance: the same seed, the same trouble."""

from __future__ import annotations

from dataclasses import dataclass

from compax_aio.simulator import camm1, haas
from compax_aio.simulator.camm1.trouble import Trouble as CutterTrouble
from compax_aio.simulator.haas.trouble import Trouble as ControlTrouble
from compax_aio.simulator.trouble import Chance, ReplyTrouble


@dataclass(frozen=True)
class Knobs:
    lose_reply: float = 0.0
    garble_reply: float = 0.0
    late_reply: float = 0.0
    late_s: float = 2.0


class Trouble(ReplyTrouble):
    """Tells what becomes of a reply."""

    def fate(self, text: str) -> tuple[str | None, float]:
        if self._loses_reply(text):
            return None, 0.0
        text = self._garbled_reply(text)
        return text, self._reply_late_s(text)


def _trouble(knobs: Knobs, seed: int = 1) -> tuple[Trouble, list[str]]:
    said: list[str] = []
    return Trouble(knobs, Chance(seed), said.append), said


def test_what_never_happens_leaves_other_chance_as_it_is() -> None:
    chance, other = Chance(5), Chance(5)
    assert not chance.happens(0.0)
    assert chance.random() == other.random()
    assert chance.happens(1.0)
    assert not chance.happens(1e-12)


def test_what_a_test_asks_for_befalls_the_next_replies_and_no_more() -> None:
    trouble, said = _trouble(Knobs())
    trouble.replies_to_lose, trouble.replies_to_garble = 1, 1
    trouble.replies_to_delay_s.append(0.5)
    assert trouble.fate("A") == (None, 0.0)
    garbled, late_s = trouble.fate("1024")
    assert garbled is not None
    assert len(garbled) == 4
    assert garbled != "1024"
    assert late_s == 0.5
    assert trouble.fate("C") == ("C", 0.0)
    assert said == ["reply A lost", f"reply 1024 became {garbled!r}", f"reply {garbled} 0.5 s late"]


def test_trouble_that_is_ended_does_not_come() -> None:
    trouble, said = _trouble(Knobs())
    trouble.replies_to_lose = trouble.replies_to_garble = 3
    trouble.replies_to_delay_s.append(1.0)
    trouble.end()
    assert trouble.fate("A") == ("A", 0.0)
    assert said == []


def test_an_empty_reply_cannot_be_garbled() -> None:
    trouble, _ = _trouble(Knobs(garble_reply=1.0, late_reply=1.0))
    assert trouble.fate("") == ("", 2.0)


def test_the_same_seed_has_the_same_replies_befallen() -> None:
    knobs = Knobs(lose_reply=0.2, garble_reply=0.2, late_reply=0.2)
    (first, _), (second, _) = _trouble(knobs, 7), _trouble(knobs, 7)
    drawn = [first.fate("1024") for _ in range(300)]
    assert drawn == [second.fate("1024") for _ in range(300)]
    assert 30 < sum(text is None for text, _ in drawn) < 90
    assert 20 < sum(late_s == 2.0 for _, late_s in drawn) < 80


def test_each_device_calls_it_as_it_does() -> None:
    said: list[str] = []
    cutter = CutterTrouble(camm1.Knobs(lose_reply=1.0), said.append)
    control = ControlTrouble(haas.Knobs(lose_reply=1.0), said.append)
    assert cutter.reply(b"1024") == (None, 0.0)
    assert control.reply("S/N, 1") == ((), 0.0)
    assert said == ["reply 1024 lost", "answer S/N, 1 lost"]

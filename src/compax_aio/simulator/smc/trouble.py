"""Trouble with a line, by chance from one seed or when a test says so."""

from __future__ import annotations

from collections import Counter, defaultdict, deque

from ..trouble import Chance
from .agenda import Agenda
from .knobs import Knobs
from .log import Log, LogKind

__all__ = ["Trouble"]


class Trouble:
    """
    What goes wrong, and when.

    Attributes:
        echoes_to_lose: So many echoes of each axis are still lost.
        echoes_to_garble: So many echoes of each axis still become another character.
        characters_to_lose: So many characters of the host still do not arrive.
        bits_to_flip: A bit, 0 to 7, of each of the next characters of the host that arrive.
        answers_to_delay_s: By how much the next answers of each axis are late.
    """

    def __init__(self, agenda: Agenda, knobs: Knobs, log: Log, chance: Chance) -> None:
        self._agenda = agenda
        self._knobs = knobs
        self._log = log
        self._chance = chance
        self.echoes_to_lose: Counter[str] = Counter()
        self.echoes_to_garble: Counter[str] = Counter()
        self.characters_to_lose = 0
        self.bits_to_flip: deque[int] = deque()
        self.answers_to_delay_s: dict[str, deque[float]] = defaultdict(deque)
        self._stuck_until = 0.0

    @property
    def stuck(self) -> bool:
        """Whether nothing goes to the host."""
        return self._agenda.now < self._stuck_until

    def stick(self, seconds: float) -> None:
        """Let nothing go to the host for so long."""
        self._stuck_until = max(self._stuck_until, self._agenda.now + seconds)
        self._note("", f"stuck for {seconds:g} s")

    def end(self) -> None:
        """Forget what was asked for."""
        self.characters_to_lose = 0
        self._stuck_until = 0.0
        for asked in (self.echoes_to_lose, self.echoes_to_garble, self.bits_to_flip, self.answers_to_delay_s):
            asked.clear()

    def arriving(self, byte: int) -> int | None:
        """Return what a character of the host is when it arrives; None: it does not."""
        if self._chance.happens(self._knobs.stick):
            self.stick(self._knobs.stick_s)
        if self.characters_to_lose > 0 or self._chance.happens(self._knobs.lose_character):
            self.characters_to_lose = max(0, self.characters_to_lose - 1)
            self._note("", f"{byte:02X} lost")
            return None
        bit: int | None = None
        if self.bits_to_flip:
            bit = self.bits_to_flip.popleft()
        elif self._chance.happens(self._knobs.flip_bit):
            bit = self._chance.randrange(8)
        if bit is None:
            return byte
        self._note("", f"{byte:02X} became {byte ^ 1 << bit:02X}")
        return byte ^ 1 << bit

    def noise(self) -> int | None:
        """Return a character that comes out of nothing; None: there is none."""
        if not self._chance.happens(self._knobs.noise):
            return None
        byte = self._chance.randrange(256)
        self._note("", f"noise {byte:02X}")
        return byte

    def echo(self, letter: str, byte: int) -> int | None:
        """Return what an axis sends as the echo of a character; None: nothing."""
        if self._is_next(self.echoes_to_lose, letter) or self._chance.happens(self._knobs.lose_echo):
            self._note(letter, f"echo {byte:02X} lost")
            return None
        if self._is_next(self.echoes_to_garble, letter) or self._chance.happens(self._knobs.garble_echo):
            other = byte ^ self._chance.randrange(1, 256)
            self._note(letter, f"echo {byte:02X} became {other:02X}")
            return other
        return byte

    def answer_delay_s(self, letter: str) -> float:
        """Return by how much the answer of an axis is late."""
        delays = self.answers_to_delay_s[letter]
        if delays:
            delay_s = delays.popleft()
        elif self._chance.happens(self._knobs.late_answer):
            delay_s = self._knobs.late_s
        else:
            return 0.0
        self._note(letter, f"answer {delay_s:g} s late")
        return delay_s

    def resets(self) -> bool:
        """Whether an axis resets itself now."""
        return self._chance.happens(self._knobs.spontaneous_reset)

    def jogs(self) -> bool:
        """Whether somebody moves an axis now."""
        return self._chance.happens(self._knobs.jog)

    @staticmethod
    def _is_next(counts: Counter[str], letter: str) -> bool:
        if counts[letter] <= 0:
            return False
        counts[letter] -= 1
        return True

    def _note(self, letter: str, text: str) -> None:
        self._log.add(self._agenda.now, LogKind.TROUBLE, letter, text)

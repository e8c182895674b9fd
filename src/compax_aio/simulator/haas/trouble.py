"""Trouble with a simulated control, by chance from one seed or when a test says so."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf, log
from random import Random
from typing import Final, Literal

from ..trouble import Chance, ReplyTrouble
from .knobs import Knobs

__all__ = ["ByteFault", "Trouble"]

ByteFault = Literal["parity-error", "framing-error", "overrun", "break"]
"""What can befall a byte that comes, by the name of its alarm."""

_NEVER: Final = inf


class _Distance:
    """How many bytes pass before the next one that something befalls by chance."""

    def __init__(self, chance: float, random: Random) -> None:
        self._chance = chance
        self._random = random
        self.left = self._drawn()

    def _drawn(self) -> float:
        if self._chance <= 0:
            return _NEVER
        if self._chance >= 1:
            return 0
        return int(log(1.0 - self._random.random()) / log(1.0 - self._chance))

    def passed(self, count: int) -> None:
        """Take note of bytes that passed; the last of them may be the one."""
        if count > self.left:
            self.left = self._drawn()
        else:
            self.left -= count


class Trouble(ReplyTrouble):
    """
    What goes wrong, and when.

    Args:
        knobs: Chances.
        note: Called with what was done, in words.

    Attributes:
        replies_to_double: So many answers of data collection come twice.
        foreign_replies: Texts of answers to another host that come in front of the next ones.
        xons_to_lose: So many Xon are not sent.
        xoffs_to_lose: So many Xoff are not sent.
        codes_to_lose: Names of codes that are not sent the next time: ``DC1`` ... ``DC4``.
        blocks_to_refuse: So many good blocks of XMODEM are answered by NAK.
        blocks_to_spoil: So many blocks that the control sends have a wrong sum.
        acks_to_lose: So many ACK and NAK of the control are not sent.
    """

    _knobs: Knobs

    def __init__(self, knobs: Knobs, note: Callable[[str], None]) -> None:
        self._parity = _Distance(knobs.parity_fault, Random(f"{knobs.seed} parity"))
        self._framing = _Distance(knobs.framing_fault, Random(f"{knobs.seed} framing"))
        self._spoilt = _Distance(knobs.spoil_sent, Random(f"{knobs.seed} spoilt"))
        super().__init__(knobs, Chance(knobs.seed), note, "answer")

    def end(self) -> None:
        """Forget what was asked for."""
        super().end()
        self.replies_to_double = self.xons_to_lose = self.xoffs_to_lose = 0
        self.blocks_to_refuse = self.blocks_to_spoil = self.acks_to_lose = 0
        self.foreign_replies: deque[str] = deque()
        self.codes_to_lose: set[str] = set()
        self._asked: list[tuple[int, ByteFault]] = []
        self._sent_to_spoil: list[int] = []

    # Bytes

    def spoil_byte(self, after: int, fault: ByteFault = "parity-error") -> None:
        """Let *fault* befall the byte of a file that comes behind so many others from now on."""
        self._asked = sorted([*self._asked, (after, fault)])

    def spoil_sent_byte(self, after: int) -> None:
        """Change one bit of the byte that the control sends behind so many others from now on."""
        self._sent_to_spoil = sorted([*self._sent_to_spoil, after])

    def fault_within(self, count: int) -> tuple[int, ByteFault] | None:
        """Say which of the next *count* bytes is befallen first, and by what."""
        found: list[tuple[float, ByteFault]] = [
            *self._asked[:1],
            (self._parity.left, "parity-error"),
            (self._framing.left, "framing-error"),
        ]
        first, fault = min(found, key=lambda each: each[0])
        return (int(first), fault) if first < count else None

    def came(self, count: int) -> None:
        """Take note of bytes of a file that have come."""
        self._parity.passed(count)
        self._framing.passed(count)
        if self._asked:
            self._asked = [(after - count, fault) for after, fault in self._asked if after >= count]

    def sent(self, data: bytes) -> bytes:
        """Return what becomes of bytes that the control sends."""
        if self._spoilt.left >= len(data) and not self._sent_to_spoil:
            self._spoilt.passed(len(data))
            return data
        places = {each for each in self._sent_to_spoil if each < len(data)}
        self._sent_to_spoil = [each - len(data) for each in self._sent_to_spoil if each >= len(data)]
        done = 0
        while self._spoilt.left < len(data) - done:
            place = done + int(self._spoilt.left)
            places.add(place)
            self._spoilt.passed(place - done + 1)
            done = place + 1
        self._spoilt.passed(len(data) - done)
        out = bytearray(data)
        for place in sorted(places):
            out[place] ^= 1 << self._chance.randrange(7)
            self._note(f"{data[place]:02X} sent as {out[place]:02X}")
        return bytes(out)

    # Signs

    def loses(self, sign: str) -> bool:
        """Whether this sign is lost: ``Xon``, ``Xoff``, ``ACK``, ``DC1`` ..."""
        match sign:
            case "Xon":
                is_lost = self.xons_to_lose > 0 or self._chance.happens(self._knobs.lose_xon)
                self.xons_to_lose = max(0, self.xons_to_lose - 1)
            case "Xoff":
                is_lost = self.xoffs_to_lose > 0 or self._chance.happens(self._knobs.lose_xoff)
                self.xoffs_to_lose = max(0, self.xoffs_to_lose - 1)
            case "ACK" | "NAK":
                is_lost = self.acks_to_lose > 0
                self.acks_to_lose = max(0, self.acks_to_lose - 1)
            case _:
                is_lost = sign in self.codes_to_lose or bool(getattr(self._knobs, f"drop_{sign.lower()}"))
                self.codes_to_lose.discard(sign)
        if is_lost:
            self._note(f"{sign} lost")
        return is_lost

    def refuses_block(self) -> bool:
        """Whether a good block is refused."""
        if self.blocks_to_refuse <= 0 and not self._chance.happens(self._knobs.refuse_block):
            return False
        self.blocks_to_refuse = max(0, self.blocks_to_refuse - 1)
        return True

    def spoils_block(self) -> bool:
        """Whether a block is sent with a wrong sum."""
        if self.blocks_to_spoil <= 0:
            return False
        self.blocks_to_spoil -= 1
        return True

    # Answers

    def foreign(self) -> str:
        """Return the answer to another host that comes in front; empty: none does."""
        if self.foreign_replies:
            text = self.foreign_replies.popleft()
        elif self._chance.happens(self._knobs.foreign_reply):
            text = "USING TOOL, 9"
        else:
            return ""
        self._note(f"answer to another host: {text}")
        return text

    def reply(self, text: str) -> tuple[tuple[str, ...], float]:
        """Return what becomes of an answer: none, one or two, and by how much it is late."""
        if self._loses_reply(text):
            return (), 0.0
        text = self._garbled_reply(text)
        texts: tuple[str, ...] = (text,)
        if self.replies_to_double > 0 or self._chance.happens(self._knobs.double_reply):
            self.replies_to_double = max(0, self.replies_to_double - 1)
            self._note(f"answer {text} doubled")
            texts = (text, text)
        return texts, self._reply_late_s(text)

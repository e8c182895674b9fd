"""A cable with noise by chance, on which commands are counted, and that can fall silent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Final

from .cable import Cable, Direction, Tamper

__all__ = ["FaultyCable", "Noise"]

_WAYS: Final[dict[Direction, str]] = {"to_drive": "to the device", "to_host": "to the host"}
_CUT_WITHIN: Final = 8
"""A cut comes behind so many bytes of an answer, at most."""


@dataclass(slots=True)
class Noise:
    """
    What happens to single bytes, by chance; each way draws by itself, so that the order of both does not matter.

    Args:
        kind: ``garbled``, ``lost`` or ``doubled``.
        chance: For each byte, 0 to 1.
        seed: Any text; the same one has the same things happen to the same bytes.
    """

    kind: str
    chance: float
    seed: str
    _random: dict[Direction, Random] = field(init=False)

    def __post_init__(self) -> None:
        self._random = {way: Random(f"{self.seed} {way}") for way in _WAYS}

    def befall(self, direction: Direction, byte: int) -> bytes | None:
        """Return what becomes of a byte; None: nothing happens to it."""
        random = self._random[direction]
        if random.random() >= self.chance:
            return None
        if self.kind == "garbled":
            return bytes([byte ^ 1 << random.randrange(8)])
        return b"" if self.kind == "lost" else bytes([byte, byte])


class FaultyCable(Cable):
    """
    The cable of a device that is served with faults.

    Args:
        command_end: What ends a command on this line.
        note: Called with what befalls the line, in words.
        on_command: Called when the end of a command comes from the host, before anything is done about it.
        on_cut: Called when the line is cut, behind what has arrived.

    Attributes:
        noises: What happens to single bytes.
        is_silent: Nothing of the device comes through.
    """

    def __init__(
        self,
        command_end: bytes,
        note: Callable[[str], None],
        *,
        on_command: Callable[[], None],
        on_cut: Callable[[], None],
    ) -> None:
        super().__init__()
        self._command_end = command_end
        self._is_silence_told = False
        self._note = note
        self._on_command = on_command
        self._on_cut = on_cut
        self.noises: list[Noise] = []
        self.is_silent = False

    @property
    def is_usual(self) -> bool:
        """Never: commands are counted."""
        return False

    def note(self, what: str) -> None:
        """Tell what befell the line."""
        self._note(what)

    def cut(self) -> None:
        """Tell that the line is cut."""
        self._on_cut()

    def cut_within_answer(self, random: Random) -> None:
        """Cut the line within what the device sends next."""
        self.add(Tamper("to_host", "cut", skip=random.randrange(_CUT_WITHIN)))

    def heal(self) -> None:
        """End everything that is done to bytes."""
        super().heal()
        self.noises.clear()
        self.is_silent = False

    def tampered(self, direction: Direction, data: bytes) -> tuple[bytes, bool]:
        """Do to *data* what is due; also say whether the connection is cut behind it."""
        if direction == "to_drive":
            for _ in range(data.count(self._command_end)):
                self._is_silence_told = False
                self._on_command()
        elif self.is_silent:
            if data and not self._is_silence_told:  # once an answer, which may come byte by byte
                self._is_silence_told = True
                self.note("silent: what the device sends is kept from the host")
            return b"", False
        return super().tampered(direction, self._noisy(direction, data) if self.noises else data)

    def _noisy(self, direction: Direction, data: bytes) -> bytes:
        heard = bytearray()
        for byte in data:
            piece = bytes([byte])
            for noise in self.noises:
                befallen = noise.befall(direction, byte)
                if befallen is not None:
                    piece = befallen
                    self.note(f"{noise.kind} {_WAYS[direction]}: {bytes([byte])!r} became {befallen!r}")
            heard += piece
        return bytes(heard)

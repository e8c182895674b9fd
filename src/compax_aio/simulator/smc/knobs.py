"""What can be set on a simulated party line: what no page at hand says, the mechanics, times, and trouble by chance."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, ClassVar, Final, Literal

from compax_aio.smc.facts import COMMANDS, INSTRUCTION_BYTES, MAX_AXES, POSSIBLE_NAMES, Mode

from ..knob_fields import Range, impossible
from ..knobs import DeviceKnobs, Probability, Seconds

__all__ = ["SIGN_ONS", "Knobs"]

_OTHER_INSTRUCTION_BYTES: Final = 5
_NO_LIMIT: Final = 1e12

SIGN_ONS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType({
    "max2000-1.15i": ("1342     4038 ADVANCED MICRO SYSTEMS, INC\r\nMAX-2000 v1.15i\r\n", "#"),
    "ams-pre-1.14": ("AMS 1.12\r\n", "#"),
    "mcpherson-2.55": ("v2.55\r\n", ""),
})  # fmt: skip
"""Text of a sign-on, and the prompt at once behind it (motorIms, panther, 789A-4)."""


class _Names:
    def __str__(self) -> str:
        return f"1 to {MAX_AXES} different letters, A-Z and a-z"

    def allows(self, value: str) -> bool:
        return 1 <= len(value) <= MAX_AXES and len(set(value)) == len(value) and set(value) <= set(POSSIBLE_NAMES)


class _Text:
    def __str__(self) -> str:
        return f"{', '.join(SIGN_ONS)}, or up to 80 characters of ASCII with their CR LF"

    def allows(self, value: str) -> bool:
        return len(value) <= 80 and value.isascii()


class _Lengths:
    _FORM = re.compile(f"[{re.escape(''.join(COMMANDS))}][1-9]")

    def __str__(self) -> str:
        return "commands and their bytes, 1 to 9: 'V4 K3'"

    def allows(self, value: str) -> bool:
        return all(self._FORM.fullmatch(each) for each in value.split())


_ServiceTime = Annotated[float, Range(0.00001, 1)]
_Place = Annotated[float, Range(-_NO_LIMIT, _NO_LIMIT)]
_Speed = Annotated[int, Range(1, 1_000_000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs(DeviceKnobs):
    """
    How one simulated line and its axes behave where no source at hand says it, and what they move.

    Where there are several readings, the default is the likeliest, and each other one can be set.

    Raises:
        TransportError: A value is not possible; says which are.
    """

    device: ClassVar[str] = "SMC line"

    # The line

    mode: Literal["single", "party", "daisy"] = "party"
    """How the axes are wired, and what their input says at every reset (DCB p. 20)."""
    axes: Annotated[str, _Names()] = "A"
    """A controller for each letter, which is the name it has stored; daisy: in the order of the ring."""
    baudrate: Literal[0, 1200, 2400, 4800, 9600, 19200, 38400] = 0
    """Byte timing of both directions, ten bits a byte; 0: bytes take no time."""
    echo_leading_lf: bool = False
    """In a party line an LF that ends no command of any axis is echoed by all of them (DCB p. 26 waits for none)."""
    abort_echo: Literal["none", "all"] = "none"
    """ESC and ^C, which name nobody, are echoed by no axis or by all at once; a ring passes them on."""
    collision: Literal["merge", "garble", "first"] = "merge"
    """What becomes of bytes of two axes at one time: one with the bits of both, any one, or the one that was first."""

    # The one-character UART

    uart_depth: Annotated[int, Range(1, 16)] = 1
    """Characters that wait until firmware has read them (AMS p. 25: one)."""
    overrun: Literal["overwrite", "drop"] = "overwrite"
    """Of one character too many, the newer or the older is kept."""
    idle_service_s: _ServiceTime = 0.0004
    """From the arrival of a character until firmware reads it, while the axis stands (not documented)."""
    stepping_service_s: _ServiceTime = 0.002
    """The same while the axis steps (not documented)."""
    jitter: Annotated[float, Range(0, 1)] = 0.0
    """Service times are longer by up to this part, by chance."""
    execution_time_s: Seconds = 0.001
    """From the terminator of a command to its execution (not documented); characters wait in the UART meanwhile."""

    # Entry

    command_length: Annotated[int, Range(1, 80)] = 12
    """Characters of a command (AMS p. 25)."""
    overlong: Literal["ignore", "beep", "abort"] = "ignore"
    """More of them are echoed and ignored, answered with BEL, or the first one ends the command unexecuted."""
    half_entered: Literal["execute", "clear"] = "execute"
    """LF executes whatever was entered, a number that is missing is 0 (DCB p. 27); or it forgets such a command."""
    backspace: Literal["back", "erase"] = "erase"
    """In single mode BS is echoed as BS, or as BS, blank, BS."""
    sign_on: Annotated[str, _Text()] = "max2000-1.15i"
    """Of single mode: a known one by its name, or any text."""
    sign_on_prompt: Literal["known", "none", "bare", "framed"] = "known"
    """What follows the sign-on at once: as known of it, nothing, ``#``, or ``#`` CR LF."""
    prompt: Literal["framed", "bare"] = "framed"
    """The answer to an empty line in single mode: ``#`` CR LF or ``#``."""
    reset_time_s: Seconds = 0.15
    """After a reset nothing is received for so long (drivers wait 0.2 to 1 s)."""
    reset_keeps_position: bool = False
    """^C leaves the position as it is; gem-controld says that it becomes 0."""

    # Answers

    width: Annotated[int, Range(0, 20)] = 10
    """Numbers are padded on the left to so many characters (DCB p. 27: padded)."""
    decimals: Literal[0, 2] = 0
    """Of positions; 2: hundredths of steps count, too."""
    unknown: Literal["terminator", "?", "#", "nothing"] = "terminator"
    """The answer to a command that there is not or that is refused, before its terminator; or no answer at all."""
    out_of_range: Literal["clamp", "ignore", "error"] = "clamp"
    """Values too small or too large count as the nearest possible; or the command does nothing; and says ``?``."""
    second_action: Literal["wait", "reject"] = "wait"
    """An action while another runs waits for its end, terminator and all (DCB p. 27); or is refused."""
    during_program: Literal["wait", "deaf"] = "wait"
    """Any command while a program runs waits for its end (DCB p. 27: may not be given); or nothing is heard."""
    x_in_party: bool = False
    """``X`` shows the parameters in a party line, too; panther found no way."""
    stream_interval_s: Annotated[float, Range(0.01, 3600)] = 0.1
    """Between the positions that ``Z1`` sends."""

    # The axis

    min_speed: _Speed = 20
    """Steps per second that I, V, M and F take at least."""
    max_speed: _Speed = 20_000
    """And at most; a 789A-4 has 36 to 60000."""
    initial_speed: _Speed = 400
    """I as it leaves the factory."""
    slew_speed: _Speed = 3000
    """V as it leaves the factory."""
    ramp_slope: Annotated[int, Range(0, 255)] = 10
    """Both slopes of K as they leave the factory; 0: no ramp."""
    slope_unit: Annotated[float, Range(1, 1e9)] = 200_000.0
    """Steps/s² of K 1; K n has an n-th of it (the scale of K is not known)."""
    position: _Place = 0.0
    """Where the axis stands at the beginning, and what it reads until the first reset."""
    limit_min: _Place = -_NO_LIMIT
    """Where the minus limit switch is; places do not change when the origin does."""
    limit_max: _Place = _NO_LIMIT
    """Where the plus limit switch is."""
    limit_level: Literal[0, 1] = 0
    """The value of ``l`` for which these switches are right; with the other one they always say "limit" or never."""
    home: _Place = 0.0
    """Middle of the home switch."""
    home_width: Annotated[float, Range(0, 1e6)] = 10.0
    """Steps within which the home switch is on."""
    home_plus: Literal[0, 1] = 0
    """The direction of F that is plus: motorIms 0, panther 1."""
    limit_bits: Literal["ims", "panther", "789a"] = "ims"
    """The answer to ``]``: plus 1, minus 2, ``]1`` home 1; plus 2, minus 1; moving 2, home 32 after A8, 64, 128."""
    hunt_time_s: Seconds = 0.0
    """After a move the axis corrects its position for so long; that is bit 4 of ``^`` alone."""

    # The program

    program_size: Annotated[int, Range(16, 8192)] = 2048
    """Bytes of the program memory."""
    instruction_bytes: Annotated[str, _Lengths()] = ""
    """Bytes of instructions that differ from DCB p. 24, or are not there and not 5: ``V4 K3``."""
    instruction_time_s: Annotated[float, Range(0.0001, 3600)] = 0.001
    """What an instruction of a program takes (not documented)."""
    wait_unit_s: Annotated[float, Range(0.0001, 3600)] = 0.01
    """What W 1 waits (not known)."""

    # Trouble, by chance

    seed: Annotated[int, Range(0, 2**32)] = 0
    """Of all chance."""
    lose_echo: Probability = 0.0
    """For each echo: it is not sent."""
    garble_echo: Probability = 0.0
    """For each echo: it is another character."""
    flip_bit: Probability = 0.0
    """For each character that arrives: one bit is changed."""
    lose_character: Probability = 0.0
    """For each character that arrives: it does not."""
    noise: Probability = 0.0
    """For each character that arrives: a character out of nothing is sent to the host."""
    stick: Probability = 0.0
    """For each character that arrives: nothing goes to the host for ``stick_s``."""
    stick_s: Seconds = 1.0
    """How long that lasts."""
    late_answer: Probability = 0.0
    """For each command: it is executed in time, and its answer comes ``late_s`` later."""
    late_s: Seconds = 1.0
    """How much later."""
    spontaneous_reset: Probability = 0.0
    """For each character that an axis reads: it resets itself."""
    jog: Probability = 0.0
    """For each character that an axis reads while it stands: somebody moves it by ``jog_distance``."""
    jog_distance: Annotated[float, Range(-1e6, 1e6)] = 100.0
    """In steps; below zero toward minus."""

    def _check_together(self) -> None:
        if self.limit_min >= self.limit_max:
            raise impossible(self.device, "limit_min", self.limit_min, f"less than limit_max, {self.limit_max:g}")
        if self.min_speed > self.max_speed:
            raise impossible(self.device, "min_speed", self.min_speed, f"at most max_speed, {self.max_speed}")
        if self.mode == "single" and len(self.axes) > 1:
            raise impossible(self.device, "axes", self.axes, "one axis in single mode")

    @property
    def pin(self) -> Mode:
        """The mode that the input of each axis says."""
        return Mode(self.mode)

    @property
    def byte_time_s(self) -> float:
        """How long a byte is on the wire."""
        return 10 / self.baudrate if self.baudrate else 0.0

    @property
    def sign_on_text(self) -> str:
        """What the first SPACE in single mode brings, with the prompt."""
        text, prompt = SIGN_ONS.get(self.sign_on, (self.sign_on, "#"))
        return text + {"known": prompt, "none": "", "bare": "#", "framed": "#\r\n"}[self.sign_on_prompt]

    def bytes_of(self, letter: str) -> int:
        """Return what an instruction takes in the program memory."""
        own = {each[0]: int(each[1]) for each in self.instruction_bytes.split()}
        return own.get(letter) or INSTRUCTION_BYTES.get(letter, _OTHER_INSTRUCTION_BYTES)

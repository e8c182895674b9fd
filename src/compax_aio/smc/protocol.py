"""
The SMC line, sans-IO: one character out, then nothing until its echo is back (AMS p. 25).

In step, the last character on the line was a terminator, so an axis whose name comes next takes the command. When an
echo is missing or wrong, nothing can be taken back in party line: editing is not supported (AMS p. 25), and ESC aborts
every axis. So an LF is sent, after which every axis looks for its name again; but an LF is also what starts execution
(DCB p. 27), so the axis may execute what it holds of the command. That is said by :attr:`EntryFailed.was_begun`, and
callers must reckon with it. Then, and on a new line, the axes' echoes are tried with a name and a terminator, which is
no command (DCB p. 26), before anything else is sent. In single mode characters can be taken back, and are.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from ..errors import LinkProtocolError
from ..link.contract import Event, GoesOn, Hold, InStep, MarkerSpent, Stranger
from .clearing import Clearing, Steps
from .facts import (
    LINE_FEED,
    MAX_COMMAND_LENGTH,
    PROMPT,
    SPACE,
    Mode,
    Reply,
    command_of,
)
from .protocol_events import Answered, CutShort, Damaged, EntryFailed, NamesDealt, Stray, Unreadable
from .protocol_states import BUSY, DOUBTFUL, ECHOING, TRANSITIONS, State, Step
from .settings import SmcSettings

__all__ = ["SmcProtocol"]

_MOST_OF_A_RESULT: Final = 64
_MOST_OF_A_LISTING: Final = 16_384
_MOST_OF_A_STRAY: Final = 64


class SmcProtocol:
    """
    The host's end of one line with one or more axes.

    Args:
        mode: How the axes take their commands.
        settings: How long things take.
        names: Of the axes that are known to be there, for :meth:`send_marker`; more can be added at any time.
    """

    def __init__(self, mode: Mode, settings: SmcSettings, names: str = "") -> None:
        self.state = State.IN_DOUBT
        self.names = list(names)
        self._mode = mode
        self._settings = settings
        self._text = ""
        """What is typed, or was typed last."""
        self._echoed = 0
        self._received = bytearray()
        self._clearer = Clearing(mode, settings)
        self._clearing: deque[tuple[bytes, float]] = deque()
        self._pause_s = 0.0
        self._probe = ""
        self._owing = ""
        """The axis whose command was not ended: its own echo alone shows that it says no more of it."""
        self._owing_probes = self._next_to_probe = 0
        self._is_behind_line_feed = self._wants_sign_on = self._is_heard = False
        self._may_hold = MAX_COMMAND_LENGTH
        """Characters that may stand in a buffer."""
        self._to_send: list[bytes] = []
        self._events: list[Event] = []

    # What the link asks ---------------------------------------------------------------------------------------------

    @property
    def in_doubt(self) -> bool:
        """Whether it is unknown what the axes hold of an earlier command."""
        return self.state in DOUBTFUL

    @property
    def is_busy(self) -> bool:
        """Whether an echo, a result or the end of a pause is awaited."""
        return self.state in BUSY

    @property
    def patience_s(self) -> float | None:
        """How long what is awaited may take."""
        if self.state is State.CLEARING:
            return self._pause_s
        if self.state is State.LISTING:
            return self._settings.listing_quiet_s
        return self._settings.answer_timeout_s if self.state is State.ENDING else self._settings.echo_timeout_s

    @property
    def held(self) -> Hold | None:
        """Nothing: what gets the line in step does no harm."""
        return None

    def stranger(self, *, time_is_over: bool) -> Stranger | None:  # noqa: ARG002
        """Nobody: other devices do not give themselves away."""
        return None

    # What the link does ---------------------------------------------------------------------------------------------

    def line_opened(self) -> None:
        """Take note that the line is new; half a command may stand in any axis's buffer."""
        self._step(Step.LINE_OPENED)
        self._begin_anew()
        self._may_hold = MAX_COMMAND_LENGTH

    def line_lost(self) -> None:
        """Give up what is outstanding."""
        if self.state is State.TYPING and self._echoed >= len(self._name()):
            self._note_damage("")
            self._step(Step.ECHO_FAILED)
        self._step(Step.LINE_LOST)
        self._begin_anew()

    def send(self, text: str) -> None:
        """Begin to type *text*: the axis's name and its command, without the terminator."""
        self._step(Step.COMMAND_SENT)
        self._type(text)

    def send_marker(self) -> None:
        """Clear the axes' buffers, and try whether an axis answers; each time another one, if need be."""
        self._begin_probe(self._next_name())

    def send_ahead(self, text: str) -> None:
        """
        Clear the axes' buffers, and type *text*, a stop, to get in step with.

        Not in a daisy chain: one that was reset would take its first name from it (DCB p. 24).
        """
        self._begin_probe(self._next_name() if self._mode is Mode.DAISY else text)

    def preempt(self, text: str) -> None:
        """
        Send ESC, or ^C, which may have a name behind it that a single axis takes then (DCB p. 23).

        The turn that is outstanding is over by it; the line gets in step afterwards.
        """
        if self.state in {State.TYPING, State.ENDING, State.LISTING}:
            self._events.append(CutShort(self._text, text, was_complete=self.state is not State.TYPING))
        steps = self._clearer.preempting(text, tuple(self._clearing))
        self._step(Step.PREEMPTED)
        self._to_send.clear()
        self._may_hold = 0
        self._owe("")
        self._probe = self._next_name()
        self._clear(steps)

    def time_ran_out(self) -> None:
        """Give up waiting for an echo or a result; or go on after a pause."""
        if self.state is State.CLEARING:
            self._go_on_clearing()
        elif self.state is State.LISTING:
            self._step(Step.SILENCE)
            self._owe("")
            listing = self._as_text().rstrip()  # a line end in front ends the line of the question's echo
            self._received.clear()
            self._events.append(Answered(listing))
        elif self.state in {State.TYPING, State.PROBING}:
            self._echo_failed("")
        elif self.state is State.PROBE_ENDING and PROMPT in self._as_text():
            self._end()  # where the prompt has no line of its own
        else:
            self._step(Step.TIME_RAN_OUT)
            self._owe(self._name())
            self._note_held(len(self._text) + 1)  # its terminator may have been taken for a character

    def resume(self) -> None:
        """Do nothing: the line is never held."""

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""
        data = b"".join(self._to_send)
        self._to_send.clear()
        return data

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size; see :meth:`events`."""
        strays = bytearray()
        for byte in data:
            if self._to_send and self._echoed and self.state in ECHOING:
                # It came before the next character is sent, so it is no echo of that, and the one before had two.
                self._to_send.clear()
                self._echoed -= 1
                self._echo_failed(self._text[self._echoed] + chr(byte))
            elif self.state in {State.TYPING, State.PROBING}:
                self._read_echo(byte, strays)
            elif self.state in {State.ENDING, State.LISTING, State.PROBE_ENDING}:
                self._read_result(byte)
            elif len(strays) < _MOST_OF_A_STRAY:
                strays.append(byte)
        self._is_heard = self._is_heard or bool(data)
        # LF, blanks and backspaces alone are the echoes of those that clear the buffers, or belong to an abort.
        if strays.strip(b"\r\n\b "):
            self._events.append(Stray(_text(strays)))

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
        events, self._events = self._events, []
        return events

    # Typing ---------------------------------------------------------------------------------------------------------

    def _type(self, text: str) -> None:
        self._text, self._echoed = text, 0
        self._is_behind_line_feed = False
        self._received.clear()
        self._type_next()

    def _type_next(self) -> None:
        """Send the next character, or the terminator."""
        if self._echoed < len(self._text):
            self._to_send.append(self._text[self._echoed].encode("latin-1"))
        else:
            self._to_send.append(bytes((self._mode.terminator,)))
            self._step(Step.TYPED)

    def _read_echo(self, byte: int, strays: bytearray) -> None:
        if byte == ord(self._text[self._echoed]):
            self._echoed += 1
            self._step(Step.ECHOED)
            self._type_next()
            self._events.append(GoesOn())
        elif byte == LINE_FEED and not self._echoed:
            strays.append(byte)  # of an earlier terminator that came twice, or of one that clears
            self._is_behind_line_feed = True
        elif not self._deals_names(byte):
            self._echo_failed(_text((byte,)))
        else:
            self._events.append(NamesDealt(chr(byte), offered=self._text[0]))
            if len(self._text) > 1:  # a command, or a stop, whose name was taken for the first to be dealt
                self._echo_failed(_text((byte,)))
                return
            self._echoed = 1
            self._type_next()
            self._events.append(GoesOn())

    def _deals_names(self, byte: int) -> bool:
        """Whether a daisy chain gives back the first name that none of its controllers has taken (DCB p. 24)."""
        return self._mode is Mode.DAISY and self._is_behind_line_feed and not self._echoed and byte > SPACE

    def _echo_failed(self, received: str) -> None:
        was_command = self.state in {State.TYPING, State.ENDING}
        was_begun = self._echoed >= len(self._name())
        self._step(Step.ECHO_FAILED if was_begun else Step.NAME_FAILED)
        self._note_held(self._echoed + 1)
        if was_begun:
            self._note_damage(received[:1])
        if was_command:
            self._owe(self._name() if was_begun else "")
            self._events.append(EntryFailed(self._text, self._echoed, received, was_begun))
        else:
            self._events.append(MarkerSpent())

    def _note_damage(self, received: str) -> None:
        """Tell what the axis may execute when its buffer is cleared."""
        if self._mode.has_names and self._settings.cancel_with == "line feed":
            begun, expected = self._text[1 : self._echoed], self._text[self._echoed : self._echoed + 1]
            holds = dict.fromkeys((begun, begun + expected, begun + received))
            self._events.append(Damaged(self._name(), tuple(filter(None, holds))))

    # Results --------------------------------------------------------------------------------------------------------

    def _read_result(self, byte: int) -> None:
        self._received.append(byte)
        is_listing = self.state is State.LISTING or (self.state is State.ENDING and self._asks_for_lines())
        if byte == LINE_FEED:
            if is_listing:
                self._step(Step.LINE_CAME)
                self._events.append(GoesOn())
            elif self.state is State.ENDING or not self._needs_prompt or PROMPT in self._as_text():
                self._end()
        if len(self._received) > (_MOST_OF_A_LISTING if is_listing else _MOST_OF_A_RESULT):
            self._flooded()

    def _end(self) -> None:
        was_probe = self.state is State.PROBE_ENDING
        self._step(Step.ENDED)
        self._owe("")
        self._may_hold = 0
        if was_probe and self._probe in self.names:
            self._next_to_probe = self.names.index(self._probe)  # who answers is asked first the next time
        self._events.append(self._in_step() if was_probe else Answered(self._take_received()))

    def _in_step(self) -> InStep:
        self._received.clear()
        return InStep()

    def _flooded(self) -> None:
        was_probe = self.state is State.PROBE_ENDING
        self._step(Step.FLOODED)
        self._owe(self._name())
        received = self._take_received()[:_MOST_OF_A_RESULT]
        self._events.append(MarkerSpent() if was_probe else Unreadable(self._text, received))

    @property
    def _needs_prompt(self) -> bool:
        """Whether an empty line is asked for, which a single axis answers with its prompt."""
        return not self._text

    def _asks_for_lines(self) -> bool:
        return command_of(self._text[len(self._name()) :]).reply is Reply.LINES

    def _as_text(self) -> str:
        return _text(self._received)

    def _take_received(self) -> str:
        text = self._as_text().strip()
        self._received.clear()
        return text

    # Getting in step ------------------------------------------------------------------------------------------------

    def _begin_probe(self, text: str) -> None:
        steps = self._clearer.after_command(self._may_hold, is_half_typed=self.state is State.HALF_TYPED)
        self._step(Step.MARKER_SENT)
        self._probe = text
        self._clear(steps)

    def _clear(self, steps: Steps) -> None:
        self._clearing.clear()
        self._clearing.extend(steps)
        self._send_clearing()

    def _note_held(self, characters: int) -> None:
        """Note that so many characters may stand in a buffer, beside those that were not taken back for certain."""
        self._may_hold = min(self._may_hold + characters, MAX_COMMAND_LENGTH + 1)

    def _send_clearing(self) -> None:
        step = self._clearing.popleft()
        data, self._pause_s = step
        self._wants_sign_on = self._clearer.wants_sign_on(step)
        self._is_heard = False
        self._to_send.append(data)

    def _go_on_clearing(self) -> None:
        if self._wants_sign_on and not self._is_heard:
            self._clearing.clear()  # it is deaf, as just after a reset: what it hears next may become its name
            self._step(Step.TIME_RAN_OUT)
            self._events.append(MarkerSpent())
        elif self._clearing:
            self._step(Step.PAUSED)
            self._send_clearing()
        elif self._probe or not self._mode.has_names:
            self._step(Step.CLEARED)
            self._type(self._probe)
        else:
            self._step(Step.NOBODY_TO_ASK)
            self._events.append(self._in_step())

    def _next_name(self) -> str:
        """
        Whom to ask: twice the axis that may have more to say, then one after the other.

        In a daisy chain only the first: if the controllers have no names, that is the one they are dealt from.
        """
        if self._mode is Mode.DAISY:
            return self.names[0]
        if self._owing_probes:
            self._owing_probes -= 1
            return self._owing
        if not self.names:
            return ""
        self._next_to_probe += 1
        return self.names[(self._next_to_probe - 1) % len(self.names)]

    def _owe(self, name: str) -> None:
        self._owing, self._owing_probes = name, 2 if name else 0

    def _name(self) -> str:
        return self._text[:1] if self._mode.has_names else ""

    # Turns ----------------------------------------------------------------------------------------------------------

    def _step(self, step: Step) -> None:
        try:
            self.state = TRANSITIONS[self.state, step]
        except KeyError:
            raise LinkProtocolError(
                f"{step.value!r} is not possible while {self.state.value}",
                sent=self._text,
                hint="wait for the turn to be over",
            ) from None

    def _begin_anew(self) -> None:
        self._received.clear()
        self._to_send.clear()
        self._clearing.clear()
        self._owe("")


def _text(data: bytes | bytearray | tuple[int, ...]) -> str:
    return bytes(data).decode("latin-1")

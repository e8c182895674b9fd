"""
Finding out how a drive talks, by questions alone.

Nothing is sent that can move or switch anything, whatever is at the far end, or write anything to a COMPAX:

- Until a prompt of a COMPAX has come, only status queries go out (``S17``, ``S16``, ``S30``, ``S2`` …), as whenever a
  line is brought in step. To an AMS SMC ``S`` stores what it holds already, to a CAMM-1 cutter it is the size of
  letters, a Compax3 refuses it; ``P`` would print on a cutter and begin a program in an SMC, so it waits.
- At the wrong one of the two baud rates none of these queries makes a CR, nor begins a binary command: a drive that
  hears them so has a spoilt line in its buffer, and refuses it with the next.
- What error replies look like is asked by ``S999``: a query by its form, of a number that no status has (there are
  S1 to S39, IBS p. 12). A word would be shorter, but which words mean something is not known of every drive (UG p.
  163-165 were not available).
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Final

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, UnexpectedAnswerError
from ..link.contract import Event, Lane
from ..motion.connecting import name_of
from ..transports.serial_signals import cts_level
from ..transports.url import TransportURL
from .codecs import value_text
from .conclusions import Evidence, concluded
from .facts.line import BAUD_RATES
from .findings import Attempt, ErrorStyle, ProbeReport
from .line import DriveLine
from .protocol import PositionReached, Stray
from .settings import DriveSettings

__all__ = ["UNKNOWN_STATUS", "candidates", "probe"]

UNKNOWN_STATUS: Final = "S999"
"""A query that every drive can refuse, and none can carry out."""

_RATED_SCHEMES: Final = ("serial", "rfc2217")
"""Where the baud rate is ours to choose."""
_CODE_ALONE: Final = re.compile(r"E\d+")
_IDENTIFICATION: Final = range(31, 40)
_QUERIES: Final = ("S16", "S17", "S1", "S2", "S30", "S18", "P19", "P20", "P90", "P11", "P12")


async def probe(
    url: str,
    *,
    name: str | None = None,
    settings: DriveSettings | None = None,
    baud_rates: Iterable[int] = BAUD_RATES,
    timeout_s: float = 60.0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> ProbeReport:
    """
    Find out how the drive at *url* talks, at which baud rate first; nothing moves, and nothing is written to it.

    Args:
        url: Of the line; a baud rate in it is tried first.
        name: Of the drive, for errors; the URL if not given.
        settings: What is known already; time-outs and the form of errors are taken from it.
        baud_rates: What is tried where the rate is ours to choose; by default the two of the manual (UG p. 160).
        timeout_s: For all of it.
        on_progress: Called with what is done now, in a few words.

    Raises:
        TransportError: The line cannot be opened, or was lost.
        UnexpectedAnswerError: Another device answers.
        AnswerTimeoutError: No COMPAX answers at any rate, each of which a note of the error tells; or not in time.
    """
    name = name_of(url, name)
    tried: list[Attempt] = []
    try:
        async with asyncio.timeout(timeout_s):
            for baudrate, each in candidates(url, baud_rates):
                at = f" at {baudrate} baud" if baudrate else ""
                on_progress(f"asking for a COMPAX{at}")
                prober = _Prober(name, settings or DriveSettings(), on_progress)
                attempt = await prober.open(each, baudrate)
                tried.append(attempt)
                if attempt.answers:
                    return await prober.learn(tuple(tried))
    except TimeoutError:
        raise AnswerTimeoutError(
            f"the probe was not over within {timeout_s:g} s",
            device=name,
            hint="the far end is slow, or answers now and then; see what a probe with a longer time-out says",
        ) from None
    except UnexpectedAnswerError as error:
        _tell_attempts(error, tried)
        raise
    raise _nobody(name, tried)


def candidates(url: str, baud_rates: Iterable[int]) -> list[tuple[int | None, str]]:
    """List the baud rates to be tried, each with its URL; one without a rate where that is not ours to choose."""
    parsed = TransportURL.parse(url)
    if parsed.scheme not in _RATED_SCHEMES:
        return [(None, url)]
    stated = [parsed.integer("baudrate", 0, minimum=1, maximum=12_000_000)] if "baudrate" in parsed.query else []
    return [(rate, with_option(url, "baudrate", str(rate))) for rate in dict.fromkeys([*stated, *baud_rates])]


def with_option(url: str, key: str, value: str) -> str:
    """Return *url* with one option set."""
    before, _, query = url.partition("?")
    items = [item for item in query.split("&") if item and item.partition("=")[0] != key]
    return f"{before}?{'&'.join([*items, f'{key}={value}'])}"


def _nobody(name: str, tried: list[Attempt]) -> AnswerTimeoutError:
    """Say that no COMPAX has answered, by what came instead."""
    came = [each for each in tried if each.received]
    rates = " and ".join(str(each.baudrate) for each in tried if each.baudrate)
    error = AnswerTimeoutError(
        f"no COMPAX answers{f' at {rates} baud' if rates else ''}",
        device=name,
        received=came[-1].received if came else None,
        hint=(
            "something is there and does not read well: check baud rate (8 data bits, no parity, 1 stop bit), ground "
            "and shield of the cable, and which device this is"
            if came
            else "nothing came at all: is the drive powered, is it this port, is the cable crossed (not straight) and "
            "in the drive's RS-232 socket, are RTS and CTS bridged where they are not wired? Holding all three buttons "
            "of the front panel while switching on makes it 9600 baud (UG p. 160)"
        ),
    )
    _tell_attempts(error, tried)
    return error


def _tell_attempts(error: CompaxError, tried: list[Attempt]) -> None:
    for each in tried:
        if each.baudrate and not each.answers:
            error.add_note(f"at {each.baudrate} baud: {each.told}")


class _Prober:
    """Asks one drive on one line; what it knows of it goes into the evidence."""

    def __init__(self, name: str, settings: DriveSettings, on_progress: Callable[[str], None]) -> None:
        self._settings = settings
        self._on_progress = on_progress
        self._strays: list[str] = []
        self._messages = 0
        self._url = ""
        self._baudrate: int | None = None
        self._sent: list[str] = []
        self._raw: dict[str, str] = {}
        self._refused: dict[str, str] = {}
        # A line that is lost ends the probe: what was found on it may be of another one afterwards.
        self._line = DriveLine(
            name,
            replace(settings, reconnect=False),
            on_event=self._on_event,
            on_lost=lambda _: None,
            greet=self._greet,
            on_down=lambda _: None,
            on_restored=lambda _: None,
        )

    # Opening --------------------------------------------------------------------------------------------------------

    async def open(self, url: str, baudrate: int | None) -> Attempt:
        """Try one way of talking; raises what does not depend on the rate."""
        self._url, self._baudrate = url, baudrate
        shown = str(TransportURL.parse(url))
        try:
            await self._line.link.open(url)
        except AnswerTimeoutError as error:
            told = "nothing came" if error.received is None else f"came, and reads as no answer: {error.received!r}"
            return Attempt(url=shown, baudrate=baudrate, answers=False, told=told, received=error.received)
        received = self._line.link.history.received_since_sent()
        return Attempt(url=shown, baudrate=baudrate, answers=True, told="a COMPAX answers", received=received)

    async def _greet(self) -> None:
        """Nothing: a probe asks in its own order."""

    def _on_event(self, event: Event) -> None:
        if isinstance(event, Stray):
            self._strays.append(event.text)
        elif isinstance(event, PositionReached):
            self._messages += 1

    # Asking ---------------------------------------------------------------------------------------------------------

    async def learn(self, attempts: tuple[Attempt, ...]) -> ProbeReport:
        """Ask all there is to ask, and close the line."""
        try:
            self._on_progress("asking who it is")
            identification = {number: await self._ask(f"S{number}") for number in _IDENTIFICATION}
            self._on_progress("asking how it stands and how its interface is set")
            answers = {query: await self._ask(query) for query in _QUERIES}
            self._on_progress("asking for a status that no drive has, to see how it refuses")
            error_style, error_evidence = await self._ask_error_style()
            evidence = Evidence(
                url=self._url,
                baudrate=self._baudrate,
                answers={query: text for query, text in answers.items() if text is not None},
                refused=dict(self._refused),
                raw=dict(self._raw),
                error_style=error_style,
                error_evidence=error_evidence,
                cts=await self._read_cts(),
                messages=self._messages,
                message_form=self._line.protocol.message_form,
                slowest_answer_s=self._line.link.stats.answer_time_s(100) or 0.0,
                median_answer_s=self._line.link.stats.answer_time_s(50) or 0.0,
                identification={number: value_text(text) for number, text in identification.items() if text},
            )
        finally:
            await self._line.link.close()
        return concluded(evidence, self._settings, attempts, tuple(self._sent))

    async def _ask(self, query: str) -> str | None:
        """Ask once; None if the drive refuses, or does not answer."""
        self._sent.append(query)
        try:
            answer = await self._line.query(query, Lane.READ)
        except (CommandRejectedError, UnexpectedAnswerError) as error:
            self._refused[query] = error.received or str(error.what)
            return None
        except AnswerTimeoutError:
            self._refused[query] = "no answer"
            return None
        self._raw[query] = self._line.link.history.received_since_sent() or ""
        return answer

    async def _ask_error_style(self) -> tuple[ErrorStyle, str]:
        self._sent.append(UNKNOWN_STATUS)
        self._strays.clear()
        try:
            answer = await self._line.query(UNKNOWN_STATUS)
        except CommandRejectedError as error:
            received = (error.received or "").strip()
            style = ErrorStyle.CODE if _CODE_ALONE.fullmatch(received) else ErrorStyle.CODE_AND_TEXT
            return style, f"{UNKNOWN_STATUS} was answered by {received!r}"
        except AnswerTimeoutError:
            texts = [text for text in self._strays if text]
            if texts:
                return ErrorStyle.OTHER_TEXT, f"{UNKNOWN_STATUS} was answered by {texts[0]!r}"
            if self._strays:
                return ErrorStyle.PROMPT_ONLY, f"{UNKNOWN_STATUS} was answered by a bare prompt"
            return ErrorStyle.SILENT, f"{UNKNOWN_STATUS} was not answered within {self._settings.answer_timeout_s:g} s"
        except UnexpectedAnswerError as error:
            return ErrorStyle.OTHER_TEXT, f"{UNKNOWN_STATUS} was answered by {error.received!r}"
        return ErrorStyle.UNKNOWN, f"{UNKNOWN_STATUS} was answered by {answer!r}, as if there were such a status"

    async def _read_cts(self) -> bool | None:
        port = self._line.link.extra_info("serial")
        return None if port is None else await asyncio.to_thread(cts_level, port)

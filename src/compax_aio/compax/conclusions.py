"""From what a drive answered to a probe to what that means, how well it is founded, and which settings follow."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import ceil
from typing import Any, Final

from ..errors import UnexpectedAnswerError
from ..transports.url import TransportURL
from .codecs import DriveStatus, SerialInterface, decode_error, decode_interface, decode_number, value_text
from .facts.limits import MAX_POSITION, POSITION_DECIMALS_INCH
from .facts.serial_interface import INTERFACE_BITS
from .findings import Attempt, ErrorStyle, Finding, Founded, ProbeReport
from .protocol import MessageForm
from .settings import DriveSettings

__all__ = ["Evidence", "concluded"]

_TIMES_THE_SLOWEST: Final = 4
"""An answer that takes so many times as long as the slowest that was seen is late."""

_POSITION: Final = re.compile(r"[-+]?\s*\d+(?:\.(?P<decimals>\d*))?\s*(?P<unit>[A-Za-z]+)?\s*")
_HANDSHAKES: Final = ("rtscts", "xonxoff")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What was asked of one drive, and what came."""

    url: str
    baudrate: int | None
    answers: Mapping[str, str]
    """By query, what came before the prompt."""
    refused: Mapping[str, str]
    """By query, what came instead of an answer."""
    raw: Mapping[str, str]
    """By query that was answered, all that came, readable."""
    error_style: ErrorStyle
    error_evidence: str
    cts: bool | None
    messages: int
    """``$`` that came unasked."""
    message_form: MessageForm
    slowest_answer_s: float
    median_answer_s: float
    identification: Mapping[int, str]


def concluded(
    evidence: Evidence, settings: DriveSettings, attempts: tuple[Attempt, ...], sent: tuple[str, ...]
) -> ProbeReport:
    """Say what *evidence* means, and change *settings* in what it shows."""
    interface = _interface(evidence, settings)
    changes = dict(_changes(evidence, settings, interface))
    return ProbeReport(
        url=str(TransportURL.parse(_url(evidence, interface))),
        attempts=attempts,
        findings=(
            _baud_rate(evidence),
            _handshake(evidence, interface),
            _echo(evidence),
            _errors(evidence, interface),
            _p20(evidence, interface),
            _message(evidence),
            _answer_time(evidence),
            _identification(evidence),
            _axis(evidence),
            _state(evidence),
        ),
        baudrate=evidence.baudrate,
        echo=_is_echoed(evidence),
        error_style=evidence.error_style,
        interface=interface,
        cts=evidence.cts,
        identification=dict(evidence.identification),
        settings=replace(settings, **{name: value for name, (value, _) in changes.items()}),
        changed={name: why for name, (_, why) in changes.items()},
        sent=sent,
    )


# The line -------------------------------------------------------------------------------------------------------------


def _url(evidence: Evidence, interface: SerialInterface | None) -> str:
    """Return the URL that reaches the drive: with Xon/Xoff where P20 says so, and no handshake was chosen."""
    is_chosen = any(key in TransportURL.parse(evidence.url).query for key in _HANDSHAKES)
    if evidence.baudrate is not None and interface is not None and interface.xonxoff and not is_chosen:
        return f"{evidence.url}&xonxoff=1"
    return evidence.url


def _baud_rate(evidence: Evidence) -> Finding:
    told = _said(evidence, "S16")
    if "P19" in evidence.answers:
        told += f"; P19, which chooses it, is {value_text(evidence.answers['P19'])} (its coding is on no page at hand)"
    if evidence.baudrate is None:
        scheme = TransportURL.parse(evidence.url).scheme
        return Finding(
            topic="baud rate",
            found=f"not ours to choose on {scheme}://, and set right at its other end",
            founded=Founded.INFERRED,
            evidence=told,
        )
    return Finding(topic="baud rate", found=f"{evidence.baudrate} baud", founded=Founded.SEEN, evidence=told)


def _handshake(evidence: Evidence, interface: SerialInterface | None) -> Finding:
    cts = {
        None: "CTS cannot be seen on this line",
        True: "CTS is on at this port: rtscts=1 can be used",
        False: "CTS is off at this port: rtscts=1 would hold the line (a cable with three wires, or drive not ready)",
    }[evidence.cts]
    if interface is None:
        return Finding(topic="handshake", found="none is needed so far", founded=Founded.UNKNOWN, evidence=cts)
    found = "Xon/Xoff, both ways (xonxoff=1)" if interface.xonxoff else "no Xon/Xoff; RTS/CTS if it is wired"
    return Finding(
        topic="handshake", found=found, founded=Founded.INFERRED, evidence=f"P20 = {interface.raw} (UG p. 166); {cts}"
    )


def _is_echoed(evidence: Evidence) -> bool | None:
    echoed = {_has_echo(query, raw) for query, raw in evidence.raw.items() if raw}
    return echoed.pop() if len(echoed) == 1 else None


def _has_echo(query: str, raw: str) -> bool:
    """Whether what came begins with what was sent; ``S17: 0`` is an answer that leaves out a zero."""
    return raw.startswith(query) and re.match(r"\s*[:=\d]", raw[len(query) :]) is None


def _echo(evidence: Evidence) -> Finding:
    is_echoed = _is_echoed(evidence)
    if not any(evidence.raw.values()):
        told = "every query was refused, and what came with the refusals is not kept"
        return Finding(topic="echo", found="not known", founded=Founded.UNKNOWN, evidence=told)
    if is_echoed is None:
        return Finding(
            topic="echo",
            found="some lines come back, and some do not: does somebody else use the line?",
            founded=Founded.UNKNOWN,
            evidence=f"{len(evidence.raw)} queries",
        )
    found = "every line comes back before its answer, which is coped with" if is_echoed else "none"
    return Finding(topic="echo", found=found, founded=Founded.SEEN, evidence=_said(evidence, "S17"))


# What P20 and refusals say --------------------------------------------------------------------------------------------


def _interface(evidence: Evidence, settings: DriveSettings) -> SerialInterface | None:
    decode = partial(
        decode_interface,
        xonxoff_weight=settings.xonxoff_weight,
        errors_suppressed_weight=settings.errors_suppressed_weight,
    )
    if "P20" not in evidence.answers:
        return None
    try:
        return decode(evidence.answers["P20"])
    except UnexpectedAnswerError:
        return None


def _errors(evidence: Evidence, interface: SerialInterface | None) -> Finding:
    style = evidence.error_style
    has_spoken = style in {ErrorStyle.CODE, ErrorStyle.CODE_AND_TEXT, ErrorStyle.OTHER_TEXT}
    told = evidence.error_evidence
    if interface is not None and style is not ErrorStyle.UNKNOWN and interface.errors_suppressed == has_spoken:
        told += (
            f"; P20 = {interface.raw} says otherwise, as far as its bits are understood (UG p. 166): is "
            "errors_suppressed_weight another one?"
        )
    elif interface is not None:
        told += f"; P20 = {interface.raw} {'suppresses' if interface.errors_suppressed else 'lets it tell'} errors"
    founded = Founded.UNKNOWN if style is ErrorStyle.UNKNOWN else Founded.SEEN
    found = style.value
    if style is ErrorStyle.OTHER_TEXT:
        found += "; error_pattern in the settings can be made to find it"
    elif style in {ErrorStyle.PROMPT_ONLY, ErrorStyle.SILENT}:
        found += "; a refused move is found out by its status"
    return Finding(topic="errors", found=found, founded=founded, evidence=told)


def _p20(evidence: Evidence, interface: SerialInterface | None) -> Finding:
    if interface is None:
        said = evidence.answers.get("P20") or evidence.refused.get("P20", "not asked")
        return Finding(topic="P20", found="not given", founded=Founded.UNKNOWN, evidence=f"P20: {said!r}")
    meanings = [bit.meaning_when_set for bit in INTERFACE_BITS if bit.name and getattr(interface, bit.name)]
    if interface.unknown:
        meanings.append(f"bits of unknown meaning, {interface.unknown} together")
    return Finding(
        topic="P20",
        found=f"{interface.raw}: {'; '.join(meanings) or 'no Xon/Xoff, errors are told, no binary transfer'}",
        founded=Founded.READ,
        evidence=f"{_said(evidence, 'P20')} (UG p. 166; which bit does what is in part inferred)",
    )


def _message(evidence: Evidence) -> Finding:
    if evidence.message_form is not MessageForm.UNKNOWN:
        return Finding(
            topic="$ message", found=evidence.message_form.value, founded=Founded.SEEN, evidence="of this conversation"
        )
    told = "only a move with $ shows it, and a probe moves nothing; the first move finds it out by itself"
    if evidence.messages:
        told = f"a $ came {evidence.messages} times: a move of somebody else ended; {told}"
    return Finding(topic="$ message", found="not known", founded=Founded.UNKNOWN, evidence=told)


# The drive ------------------------------------------------------------------------------------------------------------


def _answer_time(evidence: Evidence) -> Finding:
    return Finding(
        topic="answer time",
        found=f"{evidence.median_answer_s * 1000:.0f} ms, the slowest {evidence.slowest_answer_s * 1000:.0f} ms",
        founded=Founded.SEEN,
        evidence="median and worst of this probe's answers, from the query being written on",
    )


def _identification(evidence: Evidence) -> Finding:
    values = [f"S{number} {text!r}" for number, text in evidence.identification.items()]
    return Finding(
        topic="identification",
        found=", ".join(values) or "not given",
        founded=Founded.READ if values else Founded.UNKNOWN,
        evidence="nine values (IBS p. 12); which of them is the firmware stands on no page at hand",
    )


def _axis(evidence: Evidence) -> Finding:
    told = [f"{meaning} {_value(evidence, query)}" for query, meaning in _AXIS if query in evidence.answers]
    return Finding(
        topic="axis",
        found=", ".join(told) or "not given",
        founded=Founded.READ if told else Founded.UNKNOWN,
        evidence="P90, P11, P12, S1 (UG p. 100, 104); what a value of P90 means stands on no page at hand",
    )


_AXIS: Final = (("P90", "unit P90 ="), ("P12", "travel from P12 ="), ("P11", "to P11 ="), ("S1", "position"))


def _state(evidence: Evidence) -> Finding:
    try:
        status = DriveStatus.decode(evidence.answers["S16"], evidence.answers["S17"])
    except (KeyError, UnexpectedAnswerError):
        told = f"{_said(evidence, 'S16')}; {_said(evidence, 'S17')}"
        return Finding(topic="state", found="not given", founded=Founded.UNKNOWN, evidence=told)
    words = [
        _fault(evidence) if not status.no_fault else "no fault",
        *["a warning"] * (not status.no_warning),
        "powered" if status.running else "power stage off",
        "a positioning runs" if status.command_active else "no positioning runs",
        "machine zero approached" if status.machine_zero_approached else "machine zero not approached",
    ]
    return Finding(
        topic="state", found=", ".join(words), founded=Founded.READ, evidence=f"{status.as_sent} (UG p. 209)"
    )


def _fault(evidence: Evidence) -> str:
    try:
        error = decode_error(evidence.answers["S30"])
    except (KeyError, UnexpectedAnswerError):
        error = None
    return f"fault E{error.code}, {error.meaning}" if error else "a fault, or its self-test"


# Settings -------------------------------------------------------------------------------------------------------------


def _changes(
    evidence: Evidence, settings: DriveSettings, interface: SerialInterface | None
) -> Iterator[tuple[str, tuple[Any, str]]]:
    """Yield the settings that are to differ, each with its value and why."""
    is_quiet = evidence.error_style in {ErrorStyle.PROMPT_ONLY, ErrorStyle.SILENT}
    if (is_quiet or (interface is not None and interface.errors_suppressed)) and not settings.verify_messages:
        yield "verify_messages", (True, "the drive keeps quiet about errors")
    if evidence.message_form not in {MessageForm.UNKNOWN, settings.message_form}:
        yield "message_form", (evidence.message_form, "seen in this conversation")
    yield from _changes_by_position(evidence, settings)
    travel = _travel(evidence)
    if travel is not None and settings.travel is None:
        yield "travel", (travel, "P11 and P12")
    needed_s = ceil(_TIMES_THE_SLOWEST * evidence.slowest_answer_s * 10) / 10
    if needed_s > settings.answer_timeout_s:
        slowest = f"{evidence.slowest_answer_s:.2f} s"
        yield "answer_timeout_s", (needed_s, f"{_TIMES_THE_SLOWEST} times the slowest answer, {slowest}")


def _changes_by_position(evidence: Evidence, settings: DriveSettings) -> Iterator[tuple[str, tuple[Any, str]]]:
    shown = [_POSITION.fullmatch(_value(evidence, query)) for query in ("S1", "S2") if query in evidence.answers]
    forms = [each for each in shown if each is not None]
    if not forms or len(forms) < len(shown):
        return
    has_three = all(len(each["decimals"] or "") == POSITION_DECIMALS_INCH for each in forms)
    if has_three and settings.decimals != POSITION_DECIMALS_INCH:
        yield "decimals", (POSITION_DECIMALS_INCH, "S1 and S2 are told with three, as where the unit is inches")
    units = {each["unit"] for each in forms}
    unit = units.pop() if len(units) == 1 else None
    if unit and settings.unit == DriveSettings().unit:
        yield "unit", (unit, "it stands behind the positions that the drive tells")


def _travel(evidence: Evidence) -> tuple[float, float] | None:
    """Read the travel, if it limits anything."""
    try:
        low, high = sorted(decode_number(evidence.answers[query]) for query in ("P11", "P12"))
    except (KeyError, UnexpectedAnswerError):
        return None
    return (low, high) if low < high and (low > -MAX_POSITION or high < MAX_POSITION) else None


def _value(evidence: Evidence, query: str) -> str:
    return value_text(evidence.answers[query])


def _said(evidence: Evidence, query: str) -> str:
    if query in evidence.raw:
        return f"{query} was answered by {evidence.raw[query]!r}"
    return f"{query} was not answered: {evidence.refused.get(query, 'not asked')}"

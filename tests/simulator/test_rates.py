"""A UART at the wrong baud rate hears something else, always the same."""

from __future__ import annotations

import os
import sys
import termios
from collections.abc import Iterator

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.simulator.rates import heard, rate_of, set_rate

RATES = st.sampled_from([1200, 2400, 4800, 9600, 19200, 38400, 115200])


@pytest.fixture
def terminal() -> Iterator[int]:
    far_end, near_end = os.openpty()
    yield near_end
    os.close(near_end)
    os.close(far_end)


@given(st.binary(max_size=40), RATES)
def test_at_the_right_rate_everything_is_heard(data: bytes, rate: int) -> None:
    assert heard(data, rate, rate) == data


@pytest.mark.parametrize("heard_at", [9400, 9800])
def test_a_rate_that_is_two_percent_off_is_heard_as_well(heard_at: int) -> None:
    assert heard(bytes(range(256)), 9600, heard_at) == bytes(range(256))


@pytest.mark.parametrize(
    ("sent", "sent_at", "heard_at", "hears"),
    [
        # 0x55 is a square wave of 0 1 0 1 …: at half the rate each bit time holds one period, taken at its high half.
        (b"\x55", 9600, 4800, b"\xff"),
        # 0x00 is nine low bit times and a high one: at twice the rate a frame without a stop bit, and no further edge.
        (b"\x00", 9600, 19200, b"\x00"),
        # 0x0F doubled is 00 11111111 00000000 11: a frame that ends in the ones, and one from the next edge on.
        (b"\x0f", 9600, 19200, b"\xfe\x80"),
    ],
)
def test_bits_are_taken_in_the_middle_of_the_receivers_bit_times(
    sent: bytes, sent_at: int, heard_at: int, hears: bytes
) -> None:
    assert heard(sent, sent_at, heard_at) == hears


@given(st.binary(min_size=1, max_size=40), RATES, RATES)
def test_there_is_no_more_to_hear_than_the_line_has_time_for(data: bytes, sent_at: int, heard_at: int) -> None:
    # A frame takes at least its nine and a half bit times, and the last one may end after the line has come to rest.
    assert (len(heard(data, sent_at, heard_at)) - 1) * 9.5 / heard_at <= len(data) * 10 / sent_at


@pytest.mark.parametrize("answer", [b"S001: 123.45\r\n>", b"\r\n>", b"E90\r\n>"])
@pytest.mark.parametrize(("drive_at", "host_at"), [(9600, 4800), (4800, 9600), (9600, 19200)])
def test_no_prompt_survives_the_wrong_rate(answer: bytes, drive_at: int, host_at: int) -> None:
    assert b">" not in heard(answer, drive_at, host_at)


@pytest.mark.parametrize("rate", [1200, 4800, 9600])
def test_the_rate_that_was_set_is_read(terminal: int, rate: int) -> None:
    set_rate(terminal, rate)
    assert rate_of(terminal) == rate


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere all rates are numbers")
def test_rates_without_a_code_are_read_too(terminal: int, monkeypatch: pytest.MonkeyPatch) -> None:
    serial.Serial(os.ttyname(terminal), 14400).close()
    assert rate_of(terminal) == 14400
    monkeypatch.setattr("compax_aio.simulator.rates._GET_ANY_RATE", 0)
    assert rate_of(terminal) is None


def test_a_terminal_that_is_set_to_hang_up_has_no_rate(terminal: int) -> None:
    attributes = termios.tcgetattr(terminal)
    attributes[4] = attributes[5] = termios.B0
    termios.tcsetattr(terminal, termios.TCSANOW, attributes)
    assert rate_of(terminal) is None

"""A second look says what is equal, what is not, and what only the control's screen can say."""

from __future__ import annotations

import pytest

from compax_aio.haas.language.data_file import parse_data_file
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.transfer import Damage, Kind
from compax_aio.haas.verifying import only_on_screen, verified_received, verified_sent
from compax_aio.transports.line_errors import LineErrors


def test_the_same_bytes_twice_are_equal() -> None:
    verified = verified_received(b"%\nO1\n%\n", b"%\nO1\n%\n")
    assert verified
    assert verified.equal == "byte for byte"
    assert "the same bytes came twice" in verified.proves


@pytest.mark.parametrize(
    ("second", "where"),
    [(b"%\nO2\n%\n", "from byte 3 on: 31, and then 32"), (b"%\nO1\n%", "in length: 7 bytes, and then 6")],
)
def test_what_differs_is_told_with_its_place(second: bytes, where: str) -> None:
    verified = verified_received(b"%\nO1\n%\n", second)
    assert not verified
    assert where in verified.proves


def test_a_program_that_comes_back_in_another_form_is_the_same() -> None:
    sent = parse_program_file(b"%\nO1234\nG0 X1\n%\n")
    assert verified_sent(sent, sent).equal == "byte for byte"
    assert verified_sent(sent, parse_program_file(b"\r\n%\r\nO01234\r\nG0X1\r\n\r\n%\r\n")).equal == "in content"
    verified = verified_sent(sent, parse_program_file(b"%\nO1234\nG0 X2\n%\n"))
    assert verified.equal == "no"
    assert len(verified.differences) == 1
    assert "'G0 X1' became 'G0 X2'" in verified.proves


def test_data_are_compared_by_their_numbers() -> None:
    sent = parse_data_file("%\n" + "".join(f"N{n} V0\n" for n in range(1, 9)) + "%\n", "settings")
    back = parse_data_file("%\nN0 V77\n" + "".join(f"N{n}  V 0\n" for n in range(1, 9)) + "%\n", "settings")
    assert verified_sent(sent, back).equal == "in content"
    other = parse_data_file("%\n" + "".join(f"N{n} V1\n" for n in range(1, 9)) + "%\n", "settings")
    verified = verified_sent(sent, other)
    assert [each.number for each in verified.differences] == [*range(1, 9)]
    assert verified.proves.endswith("and 3 more")


@pytest.mark.parametrize(("kind", "is_data"), [("program", False), ("programs", False), ("settings", True)])
def test_what_only_the_screen_can_say_is_said(kind: Kind, is_data: bool) -> None:
    text = only_on_screen(kind, is_read_back=False)
    assert "RS232 DONE or RS232 ABORT" in text
    assert ("data are loaded even where there is an alarm" in text) is is_data
    assert "RS232" not in only_on_screen(kind, is_read_back=True)


def test_damage_is_said_in_words() -> None:
    assert not Damage()
    assert str(Damage()) == "no damage was seen"
    assert str(Damage(places=(7, 9), bytes=2)) == "2 bytes cannot be right, at offset 7, 9"
    counted = Damage(places=(7,), bytes=1, counted=LineErrors(parity=1))
    assert counted
    assert str(counted) == "1 byte cannot be right, at offset 7 and the port has counted 1 parity error"
    assert not Damage(counted=LineErrors())


def test_of_a_drip_feed_nothing_is_stored() -> None:
    assert "nothing of it is stored" in only_on_screen("drip feed", is_read_back=False)
    assert "RS232 DONE" not in only_on_screen("drip feed", is_read_back=False)

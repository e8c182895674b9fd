"""The URL of a line is read strictly: what it says is found in its parts, and nothing of it is ignored."""

from __future__ import annotations

from contextlib import suppress
from urllib.parse import quote

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compax_aio.errors import TransportError
from compax_aio.transports import TransportURL

parse = TransportURL.parse


def test_a_device_file_with_options_is_taken_apart() -> None:
    url = parse("serial:///dev/ttyUSB0?baudrate=9600&rtscts=1&xonxoff=0")
    assert (url.scheme, url.host, url.port, url.path) == ("serial", "", None, "/dev/ttyUSB0")
    assert url.query == {"baudrate": "9600", "rtscts": "1", "xonxoff": "0"}


def test_a_windows_port_keeps_its_capitals_and_the_scheme_does_not() -> None:
    url = parse("Serial://COM3")
    assert (url.scheme, url.host, url.path) == ("serial", "COM3", "")


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("tcp://moxa:4001", "moxa", 4001),
        ("tcp://Moxa", "Moxa", None),
        ("tcp://[::1]:4001", "::1", 4001),
        ("tcp://[fe80::1%25eth0]:1", "fe80::1%eth0", 1),
        ("tcp://user:secret@moxa:65535", "moxa", 65535),
        ("tcp://:4001", "", 4001),
    ],
)
def test_host_and_port_are_told_apart(text: str, host: str, port: int | None) -> None:
    url = parse(text)
    assert (url.host, url.port) == (host, port)


def test_percent_escapes_are_decoded_and_a_plus_is_a_plus() -> None:
    url = parse("unix:///run/my%20drive%3F.sock?ca%66ile=/a+b%26c")
    assert url.path == "/run/my drive?.sock"
    assert url.query == {"cafile": "/a+b&c"}


def test_an_option_may_be_empty_or_contain_equals_signs() -> None:
    assert parse("sim://smc?a=&b=c=d").query == {"a": "", "b": "c=d"}
    assert parse("sim://smc?").query == {}


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "not of the form"),
        ("/dev/ttyUSB0", "not of the form"),
        ("://moxa:1", "not of the form"),
        ("tcp:moxa:1", "not of the form"),
        ("loop://axis#1", "not of the form.*%23"),
        ("tcp://moxa:x", "port number is 'x'"),
        ("tcp://moxa:", "port number is ''"),
        ("tcp://moxa:0", "from 1 to 65535"),
        ("tcp://moxa:65536", "from 1 to 65535"),
        ("tcp://moxa:²", "port number is"),
        ("tcp://moxa:" + "9" * 10_000, "from 1 to 65535"),
        ("tcp://::1:4001", "port number is.*from 1 to 65535"),
        ("tcp://[::1:4001", "host .* is ambiguous.*in brackets"),
        ("serial:///dev/x?baudrate=1&baudrate=2", "option 'baudrate' is given twice"),
        ("serial:///dev/x?rtscts", "option 'rtscts' has no value"),
        ("serial:///dev/x?=1", "option '=1' has no value"),
        ("serial:///dev/x?a=1&&b=2", "option '' has no value"),
        ("loop://100%", "begins no escape"),
        ("loop://%zz", "begins no escape"),
        ("loop://%ff", "is not UTF-8"),
        ("unix:///a%00b", "contains a control character"),
        ("unix:///a\nb", "contains a control character"),
    ],
)
def test_a_malformed_url_says_which_part_is_wrong(text: str, what: str) -> None:
    with pytest.raises(TransportError, match=what):
        parse(text)


def test_a_password_is_never_shown() -> None:
    url = parse("ssh://user:sec:ret@moxa:22/dev/x?a=b:c@d")
    assert str(url) == "ssh://user:***@moxa:22/dev/x?a=b:c@d"
    assert repr(url) == "TransportURL('ssh://user:***@moxa:22/dev/x?a=b:c@d')"
    assert url.text.startswith("ssh://user:sec:ret@")


@pytest.mark.parametrize(
    "text",
    [
        "ssh://user:secret@moxa:x",
        "user:secret@moxa",
        "ssh://user:secret@h?a=1&a=2",
        "ssh://user:secret/word@moxa:22",
        "ssh://user:word/secret@moxa:22",
        "ssh://user:secret?a@moxa",
        "ssh://user:a?secret@moxa",
        "ssh://user:secret%@moxa/%",
        "ssh://user:1?x=%secret@moxa",
    ],
)
def test_a_malformed_url_does_not_show_its_password_either(text: str) -> None:
    with pytest.raises(TransportError) as caught:
        parse(text)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["ssh://user:4001/secret@moxa:22", "ssh://moxa/user:secret@x", "ssh://user:1/se:cret@h"]
)
def test_a_password_that_has_become_part_of_the_path_is_not_shown(text: str) -> None:
    url = parse(text)
    assert "cret" not in str(url) + repr(url)
    with pytest.raises(TransportError) as caught:
        url.expect("ssh://host", host=True, port=True)
    assert "cret" not in str(caught.value)


def test_options_that_are_secret_by_their_name_are_not_shown() -> None:
    url = parse("vpn://gate?user=me&password=sesame&api%54oken=sesame&keyfile=/k.pem&clientSecret=sesame")
    assert str(url) == "vpn://gate?user=me&password=***&api%54oken=***&keyfile=/k.pem&clientSecret=***"
    assert "sesame" not in repr(url)
    assert url.query["password"] == "sesame"
    with pytest.raises(TransportError, match="has no option 'password'") as caught:
        url.expect("vpn://host", host=True, query=("user",))
    assert "sesame" not in str(caught.value)
    with pytest.raises(TransportError, match=r"password='\*\*\*' is not allowed") as caught:
        url.flag("password")
    assert "sesame" not in str(caught.value)


@pytest.mark.parametrize("text", ["tcp://user:secret@moxa:4001", "tcp://user@moxa:4001", "tcp://@moxa:4001"])
def test_a_user_or_password_that_would_be_ignored_is_refused(text: str) -> None:
    with pytest.raises(TransportError, match="tcp:// takes no user name or password; write it as form") as caught:
        parse(text).expect("form", host=True, port=True)
    assert "secret" not in str(caught.value)


def test_equal_urls_are_equal_and_can_be_keys() -> None:
    assert {parse("tcp://moxa:1?a=1"): "x"}[parse("tcp://moxa:1?a=1")] == "x"
    assert parse("tcp://moxa:1?a=1") != parse("tcp://moxa:1?a=2")


url = parse("sim://smc:1/path?whole=12&real=2.5&yes=1&no=0&parity=E")


def test_options_are_read_by_type() -> None:
    assert url.integer("whole", 0, minimum=0, maximum=12) == 12
    assert url.number("real", 0.0, above=0, maximum=2.5) == 2.5
    assert url.flag("yes") is True
    assert url.flag("no", default=True) is False
    assert url.choice("parity", "even", {"E": "even", "O": "odd"}) == "even"


def test_an_option_that_is_not_given_is_its_default() -> None:
    assert url.integer("other", 7, minimum=0, maximum=1) == 7
    assert url.number("other", 7.5, above=0, maximum=1) == 7.5
    assert url.flag("other") is False
    assert url.choice("other", None, {}) is None


@pytest.mark.parametrize("value", ["1.5", "x", "", "0", "11"])
def test_a_whole_number_out_of_range_names_the_range(value: str) -> None:
    with pytest.raises(TransportError, match=f"n='{value}' is not allowed; n is a whole number from 1 to 10"):
        parse(f"sim://smc?n={value}").integer("n", 1, minimum=1, maximum=10)


@pytest.mark.parametrize("value", ["x", "", "0", "10.1", "nan", "inf", "-1"])
def test_a_number_out_of_range_names_the_range(value: str) -> None:
    with pytest.raises(TransportError, match=f"n='{value}' is not allowed; n is a number above 0 and up to 10"):
        parse(f"sim://smc?n={value}").number("n", 1.0, above=0, maximum=10)


@pytest.mark.parametrize("value", ["yes", "true", "2", ""])
def test_a_flag_is_1_or_0(value: str) -> None:
    with pytest.raises(TransportError, match=f"n='{value}' is not allowed; n is one of 1, 0"):
        parse(f"sim://smc?n={value}").flag("n")


def test_a_choice_names_what_there_is_to_choose_from() -> None:
    with pytest.raises(TransportError, match="parity='E' is not allowed; parity is one of N, O"):
        url.choice("parity", 1, {"N": 1, "O": 2})


@pytest.mark.parametrize(
    ("allowed", "what"),
    [
        ({"port": True, "path": True}, "takes no host, got 'smc'"),
        ({"host": True, "path": True}, "takes no port number, got 1"),
        ({"host": True, "port": True}, "takes no path, got '/path'"),
    ],
)
def test_a_part_that_would_be_ignored_is_refused(allowed: dict[str, bool], what: str) -> None:
    with pytest.raises(TransportError, match=f"sim:// {what}; write it as sim://form"):
        url.expect("sim://form", **allowed, query=url.query)


def test_an_unknown_option_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(TransportError, match="has no option 'real'; known options: no, parity, whole, yes"):
        url.expect("", host=True, port=True, path=True, query=("whole", "yes", "no", "parity"))
    with pytest.raises(TransportError, match="has no option 'x'; known options: none"):
        parse("loop://a?x=1").expect("", host=True)


readable = st.text("aZ0 :/?#[]@!$&'()*+,;=%~.-_|\\\"é€漢😀", max_size=12)


@settings(deadline=None)
@given(
    scheme=st.from_regex(r"[a-z][a-z0-9+.-]*", fullmatch=True),
    host=readable,
    port=st.none() | st.integers(1, 65535),
    path=readable,
    query=st.dictionaries(readable.filter(bool), readable),
)
def test_every_part_survives_being_written_and_read(
    scheme: str, host: str, port: int | None, path: str, query: dict[str, str]
) -> None:
    text = f"{scheme}://{quote(host, safe='')}" + ("" if port is None else f":{port}")
    if path:
        text += f"/{quote(path)}"
    if query:
        text += "?" + "&".join(f"{quote(key, safe='')}={quote(value, safe='')}" for key, value in query.items())
    url = parse(text)
    assert (url.scheme, url.host, url.port, url.query) == (scheme, host, port, query)
    assert url.path == (f"/{path}" if path else "")
    assert str(url) == text
    assert parse(str(url)) == url


@settings(deadline=None)
@given(st.text() | st.text("ab:@/[]%?#&=\n").map("x://".__add__))
def test_any_text_is_a_url_or_a_transport_error(text: str) -> None:
    with suppress(TransportError):
        assert parse(text).text == text

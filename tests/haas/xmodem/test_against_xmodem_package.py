"""Both ends understand the package ``xmodem``, another implementation in Python."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest
from tests.haas.xmodem.peers import talk

from compax_aio.haas.xmodem import XmodemReceiver, XmodemSender

pytest.importorskip("xmodem", reason="the package xmodem is not installed")

pytestmark = pytest.mark.real_time

PEER = """
import os, select, sys
from xmodem import XMODEM

def getc(size, timeout=1):
    data = b""
    while len(data) < size and select.select([0], [], [], timeout)[0]:
        piece = os.read(0, size - len(data))
        if not piece:
            break
        data += piece
    return data or None

def putc(data, timeout=1):
    return os.write(1, data)

modem = XMODEM(getc, putc)
if sys.argv[1] == "send":
    with open(sys.argv[2], "rb") as stream:
        sys.exit(not modem.send(stream))
with open(sys.argv[2], "wb") as stream:
    sys.exit(modem.recv(stream, crc_mode=0) is None)
"""


@pytest.fixture
def data() -> bytes:
    """Any bytes; not SUB at the end."""
    return Random(9).randbytes(60_000) + b"\n%\n"


def test_what_it_sends_arrives(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "O01234").write_bytes(data)
    receiver = XmodemReceiver()
    received, code = talk(receiver, [sys.executable, "-c", PEER, "send", "O01234"], cwd=tmp_path)
    assert receiver.failure is None
    assert received == data
    assert code == 0


def test_it_gets_what_is_sent(tmp_path: Path, data: bytes) -> None:
    sender = XmodemSender(data)
    _, code = talk(sender, [sys.executable, "-c", PEER, "receive", "O01234"], cwd=tmp_path)
    assert sender.failure is None
    assert code == 0
    assert (tmp_path / "O01234").read_bytes().rstrip(b"\x1a") == data

"""Both ends understand lrzsz, the XMODEM of most Linux systems."""

from __future__ import annotations

import shutil
from pathlib import Path
from random import Random

import pytest
from tests.haas.xmodem.peers import talk

from compax_aio.haas.xmodem import FailureKind, XmodemReceiver, XmodemSender

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(
        shutil.which("sx") is None or shutil.which("rx") is None, reason="lrzsz is not installed (Debian: lrzsz)"
    ),
]

SIZE = 200_000


@pytest.fixture
def data() -> bytes:
    """Any bytes, the signs of XMODEM among them; not SUB at the end."""
    return Random(8).randbytes(SIZE) + b"\n%\n"


def test_what_sx_sends_arrives(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "O01234").write_bytes(data)
    receiver = XmodemReceiver()
    received, code = talk(receiver, ["sx", "-q", "O01234"], cwd=tmp_path)
    assert receiver.failure is None
    assert received == data
    assert code == 0
    assert receiver.strays == receiver.damaged == 0
    assert receiver.doubtful_blocks == []


def test_rx_gets_what_is_sent(tmp_path: Path, data: bytes) -> None:
    sender = XmodemSender(data)
    _, code = talk(sender, ["rx", "-q", "O01234"], cwd=tmp_path)
    assert sender.failure is None
    assert sender.ended_by == "ACK"
    assert code == 0
    assert (tmp_path / "O01234").read_bytes().rstrip(b"\x1a") == data
    assert sender.repeats == 0


def test_cancelling_ends_sx(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "O01234").write_bytes(data)

    class Impatient(XmodemReceiver):
        def receive(self, data: bytes) -> bytes:
            answer = super().receive(data)
            return self.cancel() if self.blocks == 10 else answer

    receiver = Impatient()
    _, code = talk(receiver, ["sx", "-q", "O01234"], cwd=tmp_path)
    assert receiver.failure is not None
    assert receiver.failure.kind is FailureKind.CANCELLED_HERE
    assert code != 0

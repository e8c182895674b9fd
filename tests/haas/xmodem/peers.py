"""Runs one end of ours against another program that speaks XMODEM over pipes."""

from __future__ import annotations

import os
import select
import time
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen

from compax_aio.haas.xmodem import XmodemReceiver, XmodemSender

__all__ = ["talk"]


def talk(
    end: XmodemSender | XmodemReceiver, command: list[str], *, cwd: Path, at_most_s: float = 60.0
) -> tuple[bytes, int]:
    """Run *command*, in *cwd*, and *end* against each other; return what *end* received, and how the program ended."""
    give_up_at = time.monotonic() + at_most_s
    received = bytearray()
    with Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, cwd=cwd) as peer:
        assert peer.stdin is not None
        assert peer.stdout is not None
        try:
            os.write(peer.stdin.fileno(), end.begin())
            while not end.is_over:
                assert time.monotonic() < give_up_at, "it takes too long"
                ready, _, _ = select.select([peer.stdout], [], [], min(end.patience_s, 1.0))
                if ready:
                    data = os.read(peer.stdout.fileno(), 4096)
                    assert data, f"{command[0]} ended in the middle"
                    answer = end.receive(data)
                elif end.patience_s <= 1.0:
                    answer = end.time_ran_out()
                else:
                    continue
                if answer:
                    os.write(peer.stdin.fileno(), answer)
                if isinstance(end, XmodemReceiver):
                    received += end.take()
            peer.wait(timeout=20)
        finally:
            peer.kill()
    return bytes(received), peer.returncode

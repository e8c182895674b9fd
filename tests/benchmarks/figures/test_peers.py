"""Every peer asks the same, and gives its caller the same number."""

from __future__ import annotations

import inspect

import pytest
from benchmarks.far_ends.canned import POSITION
from benchmarks.figures.peers import PEERS, Peer, Where, number_in
from benchmarks.measuring import far_end


@pytest.mark.real_time
@pytest.mark.parametrize("peer", PEERS, ids=lambda each: each.name)
async def test_a_peer_gives_the_position(peer: Peer) -> None:
    if not peer.is_installed:
        pytest.skip("not installed")
    with far_end("benchmarks.far_ends.canned", "1") as far:
        async with peer.open(Where(far.where["tcp"], far.where["pty"][0])) as ask:
            for _ in range(2):
                asked = ask()
                assert inspect.isawaitable(asked) is not peer.blocks
                assert (await asked if inspect.isawaitable(asked) else asked) == POSITION


@pytest.mark.parametrize("answer", [b"S001: 120.50\r\n>", b"S001: 120.50\r\n", "S001: 120.50\r\n>", "S001: 120.50"])
def test_a_number_is_read_with_its_prompt_or_without(answer: bytes | str) -> None:
    assert number_in(answer) == 120.5


def test_peers_have_names_of_their_own() -> None:
    assert len({peer.name for peer in PEERS}) == len(PEERS)
    assert {peer.medium for peer in PEERS} == {"TCP", "pty"}

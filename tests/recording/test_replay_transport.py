"""``replay://`` as a transport: as much of the conformance suite as a far end can keep whose words are written down."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from tests.conformance.far_ends import FarEnd
from tests.conformance.transport import TransportConformance, Witness
from tests.recording.traces import write

from compax_aio.link.taps import Lost, Opened, Opening, Received, Sent
from compax_aio.recording.trace_entries import LineMade
from compax_aio.transports import open_transport

BEGINNING = [(0.0, "x", LineMade()), (0.0, "x", Opening("any")), (0.0, "x", Opened())]


class NoFarEnd:
    """Says nothing but what is written down, and is there to nobody."""

    async def read(self, count: int) -> bytes:
        raise NotImplementedError

    async def write(self, data: bytes) -> None:
        raise NotImplementedError

    async def hang_up(self) -> None:
        return


class TestReplay(TransportConformance):
    # A far end that speaks and listens as the test likes is no trace; that of loop://, which carries the bytes, is
    # tried by these in its own tests.
    test_all_256_values_go_both_ways_unchanged = None  # type: ignore[assignment]
    test_pieces_arrive_in_the_order_of_writing = None  # type: ignore[assignment]
    test_much_data_goes_both_ways_at_once = None  # type: ignore[assignment]
    test_nothing_is_received_while_reading_is_paused = None  # type: ignore[assignment]
    test_reading_that_is_paused_by_connection_made_stays_paused = None  # type: ignore[assignment]
    test_writing_pauses_above_the_high_mark_and_resumes_at_the_low_one = None  # type: ignore[assignment]
    test_what_was_written_before_close_arrives = None  # type: ignore[assignment]
    test_what_is_written_after_close_is_ignored = None  # type: ignore[assignment]
    test_nothing_is_received_after_close = None  # type: ignore[assignment]
    test_abort_loses_the_connection_within_a_second_while_another_line_answers = None  # type: ignore[assignment]
    test_a_far_end_that_hangs_up_ends_the_line = None  # type: ignore[assignment]
    test_a_far_end_that_hangs_up_ends_the_line_at_once_when_bytes_are_unsent = None  # type: ignore[assignment]
    test_a_protocol_that_fails_loses_its_line_and_is_reported = None  # type: ignore[assignment]
    test_another_protocol_can_take_over = None  # type: ignore[assignment]

    @pytest.fixture(autouse=True)
    def trace(self, tmp_path: Path) -> None:
        self.path = write(tmp_path / "trace.jsonl", [*BEGINNING, (0.0, "x", Sent(b"bye"))])

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        yield f"replay://{self.path}?mode=lenient", NoFarEnd()


async def opened(path: Path, witness: Witness) -> asyncio.Transport:
    return await open_transport(f"replay://{path}", lambda: witness)


async def test_all_256_values_go_both_ways_unchanged(tmp_path: Path) -> None:
    every = bytes(range(256))
    path = write(tmp_path / "trace.jsonl", [*BEGINNING, (0.1, "x", Sent(every)), (0.2, "x", Received(every))])
    witness = Witness()
    transport = await opened(path, witness)
    transport.write(every)
    assert await witness.receives(256) == every
    transport.abort()
    await witness.is_lost()


async def test_nothing_is_received_while_reading_is_paused(tmp_path: Path) -> None:
    path = write(tmp_path / "trace.jsonl", [*BEGINNING, (0.1, "x", Received(b"meanwhile")), (0.2, "x", Lost())])
    witness = Witness(pauses_at_once=True)
    transport = await opened(path, witness)
    await asyncio.sleep(5)
    assert not witness.data
    assert not witness.losses
    transport.resume_reading()
    assert await witness.receives(9) == b"meanwhile"
    await witness.is_lost()
    assert witness.losses == [None]


async def test_another_protocol_can_take_over(tmp_path: Path) -> None:
    path = write(tmp_path / "trace.jsonl", [*BEGINNING, (0.1, "x", Received(b"for the heir"))])
    witness, heir = Witness(), Witness()
    transport = await opened(path, witness)
    transport.set_protocol(heir)
    assert await heir.receives(12) == b"for the heir"
    transport.abort()
    await heir.is_lost()


async def test_what_was_to_be_played_is_forgotten_when_the_line_is_closed(tmp_path: Path) -> None:
    path = write(tmp_path / "trace.jsonl", [*BEGINNING, (9.0, "x", Received(b"late"))])
    witness = Witness()
    transport = await opened(path, witness)
    await asyncio.sleep(1)
    transport.close()
    await witness.is_lost()
    await asyncio.sleep(20)
    assert not witness.data

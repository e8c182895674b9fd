"""The driver of a host holds its program up when it is full or the wire is stopped, and lets it go half empty."""

from __future__ import annotations

from math import inf

from compax_aio.simulator.host_driver import HostDriver
from compax_aio.simulator.wire import Wire


def _arrive(wire: Wire, until: float) -> None:
    while count := wire.arrived(until):
        wire.take(count)


def test_a_full_driver_holds_the_program_until_it_is_half_empty() -> None:
    wire = Wire(1.0)
    driver = HostDriver(wire, 10, lost_on_close=False)
    wire.write(bytes(10), 0.0)
    assert not driver.holds_program()
    assert driver.next_at() == inf
    wire.write(bytes(1), 0.0)
    assert driver.holds_program()
    assert driver.next_at() == 6.0
    _arrive(wire, 5.5)
    assert driver.holds_program()
    _arrive(wire, 6.0)
    assert not driver.holds_program()


def test_a_stopped_wire_holds_the_program_for_a_time_that_nobody_knows() -> None:
    wire = Wire(1.0)
    driver = HostDriver(wire, 10, lost_on_close=False)
    wire.stop(0.0)
    wire.write(bytes(20), 0.0)
    assert driver.holds_program()
    assert driver.next_at() == inf
    wire.go_on(50.0)
    assert driver.next_at() == 65.0


def test_what_was_not_sent_is_lost_with_the_port_only_where_that_is_so() -> None:
    for is_lost in (True, False):
        wire = Wire(1.0)
        driver = HostDriver(wire, 10, lost_on_close=is_lost)
        wire.write(bytes(8), 0.0)
        assert driver.close(2.5) == (5 if is_lost else 0)
        assert len(wire) == (3 if is_lost else 8)

"""Time goes forward for a simulated device whoever gives it, and who serves it learns what hands have done."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from compax_aio.simulator.camm1 import SimulatedCutter
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.haas import SimulatedControl
from compax_aio.simulator.served_device import ServedDevice
from compax_aio.simulator.smc import SimulatedPartyLine


class Device(ServedDevice):
    """Notes what happens to it, and how late it was."""

    def __init__(self) -> None:
        super().__init__("device")
        self.seen: list[tuple[str, float]] = []
        self._now = 0.0

    def power_off(self, now: float | None = None) -> None:
        self.act(now, lambda: self.seen.append(("off", self._now)))

    def power_on(self, now: float | None = None) -> None:
        self.act(now, lambda: self.seen.append(("on", self._now)))

    def _run(self, until: float) -> None:
        self._now = max(self._now, until)
        self.seen.append(("run", self._now))

    def _last_told(self) -> float:
        return self._now


class Server:
    """Says that it is 7 o'clock, and notes when it is told of a change."""

    def __init__(self, device: Device) -> None:
        self._device = device
        device.served_by = self

    def time(self) -> float:
        return 7.0

    def changed(self) -> None:
        self._device.seen.append(("told", self.time()))


def test_without_a_time_it_is_the_last_one() -> None:
    device = Device()
    device.advance(5.0)
    device.advance()
    device.advance(4.0)
    assert device.seen == [("run", 5.0)] * 3


def test_who_serves_it_gives_the_time_and_is_told_after_what_is_due() -> None:
    device = Device()
    Server(device)
    device.power_off()
    assert device.seen == [("run", 7.0), ("off", 7.0), ("run", 7.0), ("told", 7.0)]


def test_who_serves_it_is_told_though_hands_failed() -> None:
    device = Device()
    Server(device)

    def fail() -> None:
        raise LookupError

    with pytest.raises(LookupError):
        device.act(8.0, fail)
    assert device.seen == [("run", 8.0), ("told", 7.0)]


def test_power_goes_and_comes_at_one_time() -> None:
    device = Device()
    device.power_cycle(3.0)
    assert [each for each in device.seen if each[0] != "run"] == [("off", 3.0), ("on", 3.0)]


@pytest.mark.parametrize("kind", [SimulatedDrive, SimulatedPartyLine, SimulatedCutter, SimulatedControl])
def test_every_device_takes_an_earlier_time_for_the_last_one(
    kind: Callable[[], SimulatedDrive | SimulatedPartyLine | SimulatedCutter | SimulatedControl],
) -> None:
    device = kind()
    device.power_off(5.0)
    device.power_on(2.0)
    device.connect()
    assert {entry.at for entry in device.log} == {5.0}

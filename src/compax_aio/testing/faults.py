"""Faults on demand: what can befall a simulated drive and its line, at once or at a time of the test's clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any, Final, Literal

from compax_aio.simulator.cable import Direction, Tamper

from .simulated import SimulatedAxis
from .stage import Due, Stage

__all__ = ["Faults"]

_LAST_CODE: Final = 97
_DIRECTIONS: Final[Mapping[str, Direction]] = {"to_drive": "to_drive", "to_application": "to_host"}


@dataclass(frozen=True, slots=True)
class Faults:
    """
    Makes trouble: ``faults.cut_line()`` at once, ``faults.at(2.5).cut_line()`` when the test's clock says 2.5 s.

    It befalls the only drive of the test, or the one named: ``faults.of("x").after(1).raise_fault(55)``. All of it is
    undone at the end of the test. Called where no event loop runs yet, in a fixture or in a test that is no
    coroutine, it counts from the moment when the application opens its first line.

    Every method that takes ``for_s`` ends the trouble after so many seconds of the event loop's time; None leaves it
    until :meth:`undo` or the end of the test.
    """

    _stage: Stage = field(repr=False)
    _name: str | None = None
    _due: Due = field(default_factory=Due)

    # Where and when

    def of(self, name: str) -> Faults:
        """Return what makes trouble for the drive *name*."""
        if name not in self._stage.group:
            raise ValueError(f"no drive {name!r} was added; there are {', '.join(self._stage.group) or 'none'}")
        return replace(self, _name=name)

    def at(self, time_s: float) -> Faults:
        """Return what makes trouble when the test's clock says *time_s*; at once where that is over."""
        return replace(self, _due=Due(time_s, absolute=True))

    def after(self, delay_s: float) -> Faults:
        """Return what makes trouble in *delay_s* seconds from now."""
        return replace(self, _due=Due(delay_s))

    # The drive

    def raise_fault(self, code: int) -> None:
        """Let a fault (E1 to E57) stop the axis, or a warning (E58 to E97) come; 55 is the emergency stop."""
        if not 1 <= code <= _LAST_CODE:
            raise ValueError(f"a fault code is 1 to {_LAST_CODE}, not {code}")
        axis = self._axis()
        self._do(f"fault E{code}", lambda: axis.far_end.raise_fault(code))

    def power_cycle(self, off_s: float | None = 0.0) -> None:
        """Switch the drive off, and on again after *off_s* seconds; None: not before :meth:`undo`."""
        axis = self._axis()

        def switch_off() -> None:
            axis.power_down()
            if off_s == 0:
                axis.power_up()
            else:
                self._stage.later(off_s, axis.power_up)

        self._do("power off", switch_off)

    def silent(self, for_s: float | None = None) -> None:
        """Let the drive execute everything and send nothing."""
        self._hold("silent", "silent", True, False, for_s)

    def deaf(self, for_s: float | None = None) -> None:
        """Let the drive receive nothing."""
        self._hold("deaf", "deaf", True, False, for_s)

    def late_answers(self, by_s: float, for_s: float | None = None) -> None:
        """Let answers begin *by_s* seconds later than they should; commands are executed in time."""
        self._hold(f"answers {by_s:g} s late", "extra_answer_delay_s", Due(by_s).seconds, 0.0, for_s)

    def late_position_reached(self, by_s: float, for_s: float | None = None) -> None:
        """Let the message ``$`` come *by_s* seconds later than the axis has reached its position."""
        self._hold(f"position reached {by_s:g} s late", "delay_position_reached_s", Due(by_s).seconds, 0.0, for_s)

    def lose_answers(self, count: int = 1) -> None:
        """Keep the next *count* answers or messages from the line; what they answer is executed."""
        self._add(f"{count} answers lost", "lose_answers", count)

    def lose_position_reached(self, count: int = 1) -> None:
        """Keep the next *count* messages ``$`` from the line."""
        self._add(f"{count} times position reached lost", "lose_position_reached", count)

    # The line

    def noise(self, data: bytes) -> None:
        """Let *data* arrive at the application, as from a bad cable."""
        axis = self._axis()
        self._do(f"noise {data!r}", lambda: axis.far_end.inject(data))

    def cut_line(self, for_s: float | None = 0.0) -> None:
        """Cut the connection, and let nobody connect for *for_s* seconds; the axis goes on."""
        axis = self._axis()

        def cut() -> None:
            line = axis.line.here()
            line.refused = True
            line.cut()
            if for_s == 0:
                line.refused = False
            else:
                self._stage.later(for_s, lambda: setattr(line, "refused", False))

        self._do("line cut", cut)

    def dead_line(self, for_s: float | None = None) -> None:
        """Let everything vanish both ways on a connection that seems to be there, as behind a hung device server."""
        axis = self._axis()

        def vanish() -> None:
            line = axis.line.here()
            line.vanishing = True
            self._stage.later(for_s, lambda: setattr(line, "vanishing", False))

        self._do("line dead", vanish)

    def slow_line(
        self,
        by_s: float,
        for_s: float | None = None,
        *,
        direction: Literal["to_drive", "to_application"] = "to_application",
    ) -> None:
        """Let bytes of one direction arrive *by_s* seconds later."""
        way, delay_s = _direction(direction), Due(by_s).seconds
        axis = self._axis()

        def slow_down() -> None:
            line = axis.line.here()
            line.delay_s[way] = delay_s
            self._stage.later(for_s, lambda: line.delay_s.update({way: 0.0}))

        self._do(f"bytes {direction} {by_s:g} s late", slow_down)

    def garble(self, count: int = 1, *, direction: Literal["to_drive", "to_application"] = "to_application") -> None:
        """Let the next *count* bytes of one direction arrive with their highest bit set, as parity errors do."""
        way = _direction(direction)
        axis = self._axis()
        self._do(f"{count} bytes {direction} garbled", lambda: axis.line.here().add(Tamper(way, "garble", count=count)))

    # Many

    def from_seed(self, seed: int, *, during_s: float = 10.0, count: int = 5) -> None:
        """
        Draw troubles from a seed: any of those that an application has to survive; the same from the same seed.

        What happened is told when the test fails.

        Args:
            seed: Any whole number; ``@pytest.mark.parametrize("seed", range(50))``.
            during_s: They begin at some time from now until so many seconds later.
            count: How many.
        """
        random = Random(seed)
        names = [self._name] if self._name is not None else list(self._stage.group)
        if not names:
            raise ValueError("add a drive first: no trouble without one")
        for _ in range(count):
            begins_s = self._due.seconds + round(random.uniform(0, during_s), 3)
            _draw(random)(replace(self, _name=random.choice(names), _due=Due(begins_s, self._due.absolute)))

    def undo(self) -> None:
        """Forget all faults that wait, and end all that last, of every drive."""
        self._stage.undo()

    @property
    def happened(self) -> list[tuple[float, str]]:
        """What has happened, with the time on the test's clock, oldest first."""
        return list(self._stage.happened)

    def assert_all_happened(self) -> None:
        """Assert that no fault still waits for its time: that the test has really seen them all."""
        __tracebackhide__ = True
        if self._stage.waiting:
            raise AssertionError(f"has not happened before the test was over: {', '.join(self._stage.waiting)}")

    # How

    def _axis(self) -> SimulatedAxis:
        group = self._stage.group
        if self._name is not None:
            return group[self._name]
        if len(group) != 1:
            known = (
                f"there are {', '.join(group)}; name one: faults.of({next(iter(group))!r})"
                if group
                else "there is none"
            )
            raise ValueError(f"for which drive? {known}")
        return next(iter(group.values()))

    def _do(self, what: str, action: Callable[[], None]) -> None:
        self._stage.schedule(self._due, f"{self._axis().name}: {what}", action)

    def _hold(self, what: str, attribute: str, value: Any, usual: Any, for_s: float | None) -> None:
        far_end = self._axis().far_end

        def begin() -> None:
            setattr(far_end, attribute, value)
            self._stage.later(for_s, lambda: setattr(far_end, attribute, usual))

        self._do(what, begin)

    def _add(self, what: str, attribute: str, count: int) -> None:
        if count < 1:
            raise ValueError(f"count is 1 or more, not {count}")
        far_end = self._axis().far_end
        self._do(what, lambda: setattr(far_end, attribute, getattr(far_end, attribute) + count))


def _direction(name: str) -> Direction:
    if name not in _DIRECTIONS:
        raise ValueError(f"direction is one of {', '.join(_DIRECTIONS)}, not {name!r}")
    return _DIRECTIONS[name]


def _draw(random: Random) -> Callable[[Faults], None]:
    """Draw one trouble, with all that belongs to it."""
    lasts_s = random.choice((0.05, 0.2, 1.0, 3.0))
    by_s = random.choice((0.01, 0.1, 0.4, 1.5))
    kinds: tuple[Callable[[Faults], None], ...] = (
        lambda faults: faults.cut_line(lasts_s),
        lambda faults: faults.dead_line(lasts_s),
        lambda faults: faults.silent(lasts_s),
        lambda faults: faults.deaf(lasts_s),
        lambda faults: faults.late_answers(by_s, lasts_s),
        lambda faults: faults.lose_answers(),
        lambda faults: faults.lose_position_reached(),
        lambda faults: faults.late_position_reached(by_s, lasts_s),
        lambda faults: faults.slow_line(by_s, lasts_s),
        lambda faults: faults.raise_fault(55),
        lambda faults: faults.power_cycle(lasts_s),
    )
    return random.choice(kinds)

"""The knobs of any simulated device: checked as soon as they are made, and read from the query of a URL."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from .knob_fields import Range, check_knobs, knobs_from_query

__all__ = ["DeviceKnobs", "Probability", "Seconds"]

Seconds = Annotated[float, Range(0, 3600)]
"""A time that a device takes or waits."""
Probability = Annotated[float, Range(0, 1)]
"""Of trouble by chance; 0: never."""


class DeviceKnobs:
    """
    The knobs of one kind of device, which is a frozen dataclass with a field for each.

    Raises:
        TransportError: A value is not possible; says which are.
    """

    __slots__ = ()

    device: ClassVar[str]
    """Of what they are the knobs, for messages: ``CAMM-1 cutter``."""

    def __post_init__(self) -> None:
        check_knobs(self, self.device)
        self._check_together()

    @classmethod
    def from_query(cls, query: Mapping[str, str]) -> Self:
        """
        Read knobs from the query of a URL: ``{"baudrate": "9600"}``.

        Raises:
            TransportError: No knob has that name, or it cannot be set to that value; names those that are possible.
        """
        return knobs_from_query(cls, cls.device, query, cls._defaults_with(query))

    @classmethod
    def _defaults_with(cls, query: Mapping[str, str]) -> Mapping[str, Any]:
        """Return the values of knobs that *query* leaves out, where it makes them differ from the usual ones."""
        del query
        return {}

    def _check_together(self) -> None:
        """Look whether values that are possible each are so together; raises TransportError."""

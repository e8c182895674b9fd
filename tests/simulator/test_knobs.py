"""Knobs of any kind of device are checked, alone and together, and who errs is told of which device they are."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from compax_aio.errors import TransportError
from compax_aio.simulator import camm1, compax, haas, smc
from compax_aio.simulator.knobs import DeviceKnobs

KINDS = [compax.Knobs, smc.Knobs, camm1.Knobs, haas.Knobs]


@pytest.mark.parametrize("kind", KINDS)
def test_a_query_sets_knobs_and_leaves_the_others(kind: type[Any]) -> None:
    assert kind.from_query({"baudrate": "9600"}) == dataclasses.replace(kind(), baudrate=9600)
    assert kind.from_query({}) == kind()


@pytest.mark.parametrize("kind", KINDS)
def test_who_errs_is_told_of_which_device_and_what_is_possible(kind: type[DeviceKnobs]) -> None:
    with pytest.raises(TransportError, match=f"a simulated {kind.device} has no knob 'colour'") as unknown:
        kind.from_query({"colour": "red"})
    assert "baudrate" in str(unknown.value)
    with pytest.raises(TransportError, match=f"a simulated {kind.device} cannot have baudrate='9601'.*9600"):
        kind.from_query({"baudrate": "9601"})


@pytest.mark.parametrize(
    ("kind", "query", "blamed"),
    [
        (compax.Knobs, {"travel_min": "5", "travel_max": "1"}, "travel_min=5.0"),
        (smc.Knobs, {"mode": "single", "axes": "AB"}, "axes='AB'"),
        (camm1.Knobs, {"physical_size": "256", "logical_size": "512"}, "logical_size=512"),
        (haas.Knobs, {"hwm": "64"}, "lwm=64"),
    ],
)
def test_values_that_do_not_go_together_are_refused(
    kind: type[DeviceKnobs], query: dict[str, str], blamed: str
) -> None:
    with pytest.raises(TransportError, match=f"a simulated {kind.device} cannot have {blamed}"):
        kind.from_query(query)

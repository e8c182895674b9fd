"""Every knob is described by what stands beside it in the code."""

from __future__ import annotations

import dataclasses

import pytest

from compax_aio.simulator.compax import Knobs
from compax_aio.simulator.knob_descriptions import describe_knobs
from compax_aio.simulator.smc import Knobs as SmcKnobs


@pytest.mark.parametrize("kind", [Knobs, SmcKnobs])
def test_each_knob_has_a_meaning_values_and_a_default_that_can_be_written(kind: type[Knobs] | type[SmcKnobs]) -> None:
    described = describe_knobs(kind)
    assert [each.name for each in described] == [field.name for field in dataclasses.fields(kind)]
    assert all(each.meaning and each.values and "``" not in each.meaning for each in described)
    # What is shown can be typed: read back, it is the default again.
    assert kind.from_query({each.name: each.default for each in described}) == kind()


def test_a_knob_is_described_as_it_is() -> None:
    (decimals,) = [each for each in describe_knobs(Knobs) if each.name == "decimals"]
    assert (decimals.values, decimals.default) == ("2, 3", "2")
    assert decimals.meaning.startswith("Of positions and distances, in and out (UG p. 100)")
    (echo,) = [each for each in describe_knobs(Knobs) if each.name == "echo"]
    assert (echo.values, echo.default) == ("0, 1", "0")

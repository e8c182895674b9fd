"""The machine is described, and whether it was quiet is told by what the same work took."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.measuring import Machine, Noise
from benchmarks.measuring.machine import version


def test_the_machine_is_described(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("processor\t: 0\nmodel name\t: Abacus 3000\n")
    monkeypatch.setattr("benchmarks.measuring.machine._CPUINFO", info)
    machine = Machine.here()
    assert machine.processor == "Abacus 3000"
    assert machine.cores >= 1
    assert machine.as_dict()["python"] == machine.python
    monkeypatch.setattr("benchmarks.measuring.machine._CPUINFO", tmp_path / "none")
    assert Machine.here().processor


def test_the_version_of_what_is_not_installed_is_none() -> None:
    assert version("pytest")
    assert version("no-such-package-is-installed") is None


@pytest.mark.parametrize(
    ("cpu_s", "wall_s", "is_quiet"),
    [
        ([0.001] * 8, [0.001] * 8, True),
        ([0.001] * 8, [0.002] * 8, False),
        ([0.001, 0.002] * 4, [0.001, 0.002] * 4, False),
        ([], [], False),
    ],
)
def test_a_machine_is_quiet_if_the_same_work_takes_the_same_and_nothing_else_has_the_core(
    cpu_s: list[float], wall_s: list[float], is_quiet: bool
) -> None:
    noise = Noise(cpu_s=cpu_s, wall_s=wall_s)
    assert noise.is_quiet is is_quiet
    assert noise.as_dict()["samples"] == len(cpu_s)
    assert ("NOISY" in noise.told()) is (bool(cpu_s) and not is_quiet)


def test_a_sample_is_taken() -> None:
    noise = Noise()
    assert noise.told() == "noise not measured"
    noise.sample()
    assert noise.cpu_s[0] > 0
    assert len(noise.load) == len(noise.wall_s) == 1


def test_a_machine_on_which_more_wants_to_run_than_has_cores_is_not_quiet() -> None:
    assert Noise(cpu_s=[0.001], wall_s=[0.001], load=[0.5, 2.5], cores=2).is_quiet
    assert not Noise(cpu_s=[0.001], wall_s=[0.001], load=[0.5, 2.6], cores=2).is_quiet

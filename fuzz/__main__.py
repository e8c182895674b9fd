"""
Run one target, or all of them one after the other: ``python -m fuzz protocol -max_total_time=60``.

What follows the name goes to libFuzzer. What is found new is kept in ``.fuzz/<name>``, where the next run begins; an
input that fails is written to ``.fuzz/<name>-crash-…`` and is run again by naming it behind the target.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["compax_aio", "tomllib"]):
    from compax_aio.simulator.compax import SimulatedDrive
    from fuzz.targets import TARGETS

_KEPT = Path(".fuzz")
_SEEDS = (
    b"S001: -12.50 mm\r\n>\r\n$\r\n>E92\r\n>",
    b"\x84\x83S1\r\nS001: 0\r\n>\x81\r\n>$\r\n>",
    b"N001: POSR 10 SPEED 50\nN002: IF I7=1 GOTO 1 ; end\n",
    b"answer_timeout_s = 1.5\n[dialect]\nstop = 'STOP'\n[units.1]\nname = 'mm'\n",
    b"kind = 'parameters'\n[parameters]\nP1 = 2.5\n",
    json.dumps(SimulatedDrive().save_state()).encode(),
    b"tcp://[::1]:4001/path?baudrate=9600&a=%41",
    b"\x00PA 50\rV1=V1*V1\rN1 GOTO 1\rSTART\rSTOP\rS1\r",
)


def main() -> int:
    """Fuzz what the command line says."""
    name, *options = sys.argv[1:] or ["all"]
    if name == "all":
        commands = [[sys.executable, "-m", "fuzz", each, *options] for each in TARGETS]
        return max(subprocess.run(command, check=False).returncode for command in commands)
    kept = _KEPT / name
    kept.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(_SEEDS):
        (kept / f"seed-{number}").write_bytes(seed)
    inputs = [] if any(Path(option).is_file() for option in options) else [str(kept)]
    limits = ["-timeout=10", "-rss_limit_mb=1024", "-max_len=4096", f"-artifact_prefix={kept}-"]
    atheris.Setup([name, *limits, *options, *inputs], TARGETS[name])
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())

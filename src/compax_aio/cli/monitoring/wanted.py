"""Which axes are to be shown, as the command line names them: ``x=tcp://…`` and ``x=file.toml``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from compax_aio import DriveSettings
from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.motion.connecting import name_of

from ..opening import DriveLine

__all__ = ["WantedAxis", "wanted_axes"]

_NAMED: Final = re.compile(r"([A-Za-z_][A-Za-z0-9_.-]{0,19})=(.*)", re.DOTALL)
_MOST: Final = 64


@dataclass(frozen=True, slots=True)
class WantedAxis:
    """One axis to be shown."""

    name: str
    url: str
    settings: DriveSettings


def wanted_axes(lines: Sequence[str], settings: Sequence[str]) -> tuple[WantedAxis, ...]:
    """
    Read the axes that the command line names.

    Args:
        lines: ``tcp://host:4001``, or with a name ``x=tcp://host:4001``.
        settings: ``file.toml`` for all axes, ``x=file.toml`` for one.

    Raises:
        InvalidCommandError: There is no axis, two have one name or line, a URL is none, or a settings file is for an
            axis that is not there, or cannot be used.
    """
    if not lines:
        raise InvalidCommandError("no line was named", hint="for instance: compax monitor x=tcp://192.168.1.50:4001")
    if len(lines) > _MOST:
        raise InvalidCommandError(f"{len(lines)} lines are more than a screen can show; {_MOST} at most")
    urls: dict[str, str] = {}
    for line in lines:
        name, url = _named(line)
        if name in urls:
            raise InvalidCommandError(f"two axes are called {name}", hint="give each a name: x=URL y=URL")
        if url in urls.values() and not url.startswith("sim:"):
            raise InvalidCommandError(f"{url} is named twice", hint="each axis has a line of its own")
        urls[name] = url
    for_all, for_one = _settings(settings, urls)
    return tuple(WantedAxis(name, url, for_one.get(name, for_all)) for name, url in urls.items())


def _named(line: str) -> tuple[str, str]:
    found = _NAMED.fullmatch(line)
    name, url = (found[1], found[2]) if found else (None, line)
    try:
        full_name = name_of(url, None)
    except TransportError as error:
        raise InvalidCommandError(error.what, hint=error.hint) from error
    return name or full_name, url


def _settings(given: Sequence[str], axes: dict[str, str]) -> tuple[DriveSettings, dict[str, DriveSettings]]:
    for_all = DriveSettings()
    for_one: dict[str, DriveSettings] = {}
    for each in given:
        found = _NAMED.fullmatch(each)
        if found and found[1] in axes:
            for_one[found[1]] = _load(found[2])
        elif found and not Path(each).exists():
            raise InvalidCommandError(
                f"there is no axis {found[1]!r} for the settings {found[2]}; there are: {', '.join(axes)}"
            )
        else:
            for_all = _load(each)
    return for_all, for_one


def _load(path: str) -> DriveSettings:
    return DriveLine(settings=Path(path)).drive_settings()

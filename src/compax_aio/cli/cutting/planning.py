"""Jobs as they are about to be cut: read, set to the speed and force that are wanted, checked, and shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from compax_aio import CompaxError, camm1
from compax_aio.camm1.previewing.tool_path import drawing_of
from compax_aio.transports.url import TransportURL

from ..printing import Printing
from ..problems import expect_sound, has_errors, told
from .jobs import NamedJob, read_job_patiently
from .outline import Outline, outline_of, show_outline
from .tuning import tuned

__all__ = ["Plan", "PlannedJob", "baud_rate_of"]

_MOST_TOLD: Final = 10


@dataclass(frozen=True)
class PlannedJob:
    """A job that is about to be cut."""

    named: NamedJob
    outline: Outline
    problems: tuple[camm1.Problem, ...]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How jobs are to be cut."""

    profile: camm1.Profile
    settings: camm1.JobSettings
    sheet: camm1.Sheet | None
    baud_rate: int
    is_checked: bool
    """Whether one with an error is refused."""

    async def read(self, path: Path, printing: Printing) -> PlannedJob:
        """
        Read a job, and show what it will cut.

        Raises:
            InvalidCommandError: It cannot be read, there is an error in it, or the machine cannot be told its settings.
        """
        read = await read_job_patiently(path, self.profile)
        job = tuned(read.job, self.settings, self.profile)
        named = NamedJob(read.name, job.data, job)
        problems = camm1.check(job, self.profile, self.sheet)
        if self.is_checked:
            hint = "`compax camm1 preview` shows where; --no-check sends it all the same"
            expect_sound(named.name, problems, "the job", hint=hint)
        outline = outline_of(named, drawing_of(job.instructions), self.profile, self.baud_rate)
        show_outline(outline, printing)
        if problems:
            printing.note(told(named.name, problems[:_MOST_TOLD]).plain.rstrip())
        if len(problems) > _MOST_TOLD:
            printing.note(f"and {len(problems) - _MOST_TOLD} more, which `compax camm1 check` tells")
        if has_errors(problems):
            printing.note("--no-check: it is sent with the errors in it")
        return PlannedJob(named, outline, problems)


def baud_rate_of(url: str) -> int | None:
    """Return what *url* says, if it can be read; whoever opens it says what is wrong with it."""
    try:
        text = TransportURL.parse(url).query.get("baudrate", "")
    except CompaxError:
        return None
    return int(text) if text.isdecimal() and int(text) > 0 else None

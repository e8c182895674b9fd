"""Speed and force in place of those that a job sets."""

from __future__ import annotations

from typing import Final

from compax_aio import camm1

__all__ = ["tuned"]

_RESETTING: Final = frozenset({"IN", "DF"})
"""They bring the machine's own speed back (PNC-900 p. 18-19)."""


def tuned(job: camm1.Job, settings: camm1.JobSettings, profile: camm1.Profile) -> camm1.Job:
    """
    Return *job* with what *settings* say in front, again behind whatever resets it, and without what would undo it.

    Raises:
        InvalidCommandError: The machine cannot be told it.
    """
    words = settings.worded(profile)
    if not words:
        return job
    undoing = {"VS"} if settings.speed_cm_s is not None else set()
    if settings.force_gf is not None:
        undoing.add(str(profile.force_instruction))
    pieces = [words]
    for each in job.instructions:
        if each.name not in undoing:
            pieces.append(each.data)
        if each.name in _RESETTING:
            pieces.append(words)
    return camm1.parse(b"".join(pieces), profile)

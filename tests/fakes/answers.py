"""What a drive says, byte for byte, as the manual has it; written without the library's own reader."""

from __future__ import annotations

__all__ = ["PROMPT", "answer_to", "as_drive"]

PROMPT = b"\r\n>"


def answer_to(line: str, value: object = 0) -> bytes:
    """Answer the query *line* in the documented form: ``S18`` gives ``S018: <value>`` and the prompt."""
    return f"{line[0]}{int(line[1:]):03d}: {value}".encode() + PROMPT


def as_drive(line: str) -> bytes:
    """Answer a query with its own number as its value, and acknowledge everything else."""
    return answer_to(line, line[1:]) if line[0] in "SPVN" and line[1:].isdigit() else PROMPT

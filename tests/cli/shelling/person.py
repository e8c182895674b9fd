"""A person at the prompt of a shell, who types into a pipe and reads what is printed, on a virtual clock."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from prompt_toolkit import PromptSession
from prompt_toolkit.application import create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.formatted_text import to_formatted_text
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.output import DummyOutput
from tests.promises.cable import Cable

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings
from compax_aio.cli.shelling.session import Session
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

__all__ = ["CTRL_C", "CTRL_D", "CTRL_X", "ENTER", "Person", "sitting", "until"]

CTRL_C, CTRL_D, CTRL_X, ENTER = "\x03", "\x04", "\x18", "\r"
_CLEAR = "\x15"
"""Ctrl-U takes away what is typed; behind text Ctrl-D would take away a character."""
_LONGEST_WAIT_S = 60.0


class Paper(DummyOutput):
    """A terminal that keeps all that is written to it."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, data: str) -> None:
        self.text += data

    write_raw = write

    def get_size(self) -> Size:
        return Size(rows=40, columns=240)


class Person:
    """Somebody who types, and waits until something has happened."""

    def __init__(self, session: Session, keyboard: PipeInput, paper: Paper, drive: Drive, far: SimulatedDrive) -> None:
        self.session = session
        self.drive = drive
        self.far = far
        self._keyboard = keyboard
        self._paper = paper
        self._read_up_to = 0

    @property
    def seen(self) -> str:
        """All that was ever on the screen."""
        return self._paper.text

    @property
    def fresh(self) -> str:
        """What came since something was typed."""
        return self._paper.text[self._read_up_to :]

    def press(self, keys: str) -> None:
        """Press *keys*, without Enter."""
        self._read_up_to = len(self._paper.text)
        self._keyboard.send_text(keys)

    async def say(self, line: str, *answers: str) -> None:
        """Type a line, and wait for what is expected to be printed then."""
        self.press(line + ENTER)
        await self.sees(*answers)

    async def sees(self, *texts: str) -> None:
        """Wait until all *texts* have been printed since something was typed."""
        await until(lambda: all(text in self.fresh for text in texts), lambda: f"{texts} in {self.fresh!r}")

    @property
    def typed(self) -> str:
        """What stands behind the prompt."""
        return self.session._prompt.default_buffer.text

    @property
    def bottom(self) -> str:
        """The line at the bottom."""
        return "".join(fragment[1] for fragment in to_formatted_text(self.session._toolbar()))

    async def shows(self, *texts: str) -> None:
        """Wait until all *texts* stand in the line at the bottom."""
        await until(lambda: all(text in self.bottom for text in texts), lambda: f"{texts} in {self.bottom!r}")

    async def quiet(self, seconds: float = 1.0) -> str:
        """Let time go by; returns what was printed since something was typed."""
        await asyncio.sleep(seconds)
        return self.fresh

    def lines(self) -> list[str]:
        """Return the lines that reached the drive."""
        return [entry.text for entry in self.far.log if entry.kind is LogKind.LINE]

    def did(self, kind: LogKind) -> list[str]:
        """Return what the drive did of one kind."""
        return [entry.text for entry in self.far.log if entry.kind is kind]


async def until(condition: Callable[[], bool], what: Callable[[], str]) -> None:
    """Wait until *condition* holds, for a minute of virtual time at most."""
    loop = asyncio.get_running_loop()
    give_up_at = loop.time() + _LONGEST_WAIT_S
    while not condition():
        assert loop.time() < give_up_at, f"never: {what()}"
        await asyncio.sleep(0.05)


@asynccontextmanager
async def sitting(
    *,
    cable: Cable | None = None,
    settings: DriveSettings | None = None,
    poll_s: float | None = None,
    may_move: bool = True,
    leaves: bool = True,
    **knobs: Any,
) -> AsyncIterator[Person]:
    """Let a person sit at a shell that talks to a simulated drive; leaves by Ctrl-D at the end."""
    far, cable = SimulatedDrive(Knobs(**knobs), name="x"), cable or Cable()
    await cable.plug(far)
    with create_pipe_input() as keyboard, create_app_session(input=keyboard, output=Paper()) as terminal:
        assert isinstance(terminal.output, Paper)
        drive = await compax_aio.connect(cable.url, name="x", settings=settings)
        prompt: PromptSession[str] = PromptSession(input=keyboard, output=terminal.output)
        session = Session(drive, prompt, title="x", poll_s=poll_s, may_move=may_move)
        talk = asyncio.ensure_future(session.run())
        person = Person(session, keyboard, terminal.output, drive, far)
        try:
            await person.sees("x>")
            yield person
            if leaves:
                person.press(_CLEAR + CTRL_D)
            async with asyncio.timeout(_LONGEST_WAIT_S):
                await talk
        finally:
            talk.cancel()
            await asyncio.wait([talk])
            try:
                await drive.close()
            except CompaxError:
                assert not cable.is_plugged
            if cable.is_plugged:
                await cable.pull()

"""``compax shell``: talk to a drive line by line, at a prompt or from a script."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

from compax_aio import Drive

from ..checked_numbers import check_number
from ..errors import InvalidCommandError
from .number_words import NUMBER
from .opening import DriveLine, Url
from .printing import Printing

__all__ = ["shell"]


async def shell(
    url: Url,
    *,
    command: Annotated[
        tuple[str, ...],
        Parameter(
            alias="-c",
            negative=(),
            help="A line to carry out; it can be given several times. Without it, lines are typed, or come from "
            "standard input.",
        ),
    ] = (),
    allow_motion: Annotated[
        bool,
        Parameter(negative=(), help="Ask nothing before the first motion; a script moves nothing without it."),
    ] = False,
    poll_s: Annotated[
        float,
        NUMBER,
        Parameter(help="Seconds between two looks at position and status, for the line at the bottom; 0: none."),
    ] = 1.0,
    history: Annotated[
        bool, Parameter(help="Keep the lines typed for the next session, in the folder of the user's state.")
    ] = True,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Talk to a drive line by line, with completion and help.

    Lines go to the drive as they are, checked before a byte is sent: `S1` asks the position, `P20` a parameter, `SD50`
    sets the speed, `PA100` moves. Beside the answer stands what it means. Words of the shell itself: `move 100`,
    `home`, `stop`, `status`, `error`, `params 11-16`, `watch position`, `help S16`, `exit`; `help` lists them.

    Ctrl-X stops the axis at any time. Ctrl-C stops what was started here. Leaving stops it as well.

    Where nobody sits at a terminal, lines come from `-c` or from standard input, and the first that fails ends it.

    ```sh
    compax shell sim://compax
    compax shell serial:///dev/ttyUSB0 --settings x.toml
    compax shell tcp://192.168.1.50:4001 -c S1 -c "params 11-16" --json
    echo "move 100" | compax shell sim://compax --allow-motion
    ```
    """
    if check_number("--poll-s", poll_s) < 0:
        raise InvalidCommandError(f"--poll-s is a number of seconds, or 0, not {poll_s:g}")
    is_script = bool(command) or printing.json or not (sys.stdin.isatty() and sys.stdout.isatty())
    async with line.open(url) as drive:
        if is_script:
            from .shelling.script import Script, lines_of, lines_of_stdin  # noqa: PLC0415 - only one of the two

            script = Script(drive, printing, may_move=allow_motion)
            script.check(command)
            await script.run(lines_of(command) if command else lines_of_stdin())
        else:
            await _talk(drive, line, may_move=allow_motion, poll_s=poll_s or None, keeps_history=history)


async def _talk(drive: Drive, line: DriveLine, *, may_move: bool, poll_s: float | None, keeps_history: bool) -> None:
    """Let the person at the terminal talk."""
    from prompt_toolkit import PromptSession  # noqa: PLC0415 - heavy
    from prompt_toolkit.history import History, InMemoryHistory  # noqa: PLC0415
    from prompt_toolkit.patch_stdout import patch_stdout  # noqa: PLC0415

    from .shelling.history import LineHistory, history_file  # noqa: PLC0415
    from .shelling.session import Session  # noqa: PLC0415
    from .shelling.words import STOP_KEY  # noqa: PLC0415

    kept: History = LineHistory(history_file()) if keeps_history else InMemoryHistory()
    prompt: PromptSession[str] = PromptSession(history=kept)
    print(  # noqa: T201
        f"Talking to {drive.name}. S1 asks the position, help explains, {STOP_KEY} stops the axis, exit leaves.\n"
        "A stop from software is no emergency stop: have one in hardware, within reach."
    )
    session = Session(drive, prompt, title=line.name or "compax", poll_s=poll_s, may_move=may_move)
    with patch_stdout(raw=True):  # what is logged stands above the prompt, too
        await session.run()

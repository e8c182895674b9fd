"""Somebody who stands at the control and here: says by Enter that RECV is pressed, where the control does not."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Awaitable
from typing import Annotated, Final

from cyclopts import Parameter

from compax_aio import InvalidCommandError
from compax_aio.haas.profiles import Profile

from ..keyboard import keys_pressed
from ..printing import Printing
from .view import TransferView

__all__ = ["Operator", "Ready"]

Ready = Annotated[
    bool,
    Parameter(
        negative=(),
        help="RECV is pressed already: begin at once. Needed where nobody is at a terminal, and the control does not "
        "say it itself.",
    ),
]

_ENTER: Final = frozenset({"c-m", "c-j"})
_HUNG_UP: Final = getattr(signal, "SIGHUP", signal.SIGINT)


class Operator:
    """
    Is asked to press Enter when the control is ready.

    Args:
        profile: Of the control: with DC codes and XMODEM it says by itself that RECV was pressed.
        printing: How things are said.
        is_ready: RECV was pressed in advance.
        sends: Whether anything is sent; what comes begins by itself.

    Raises:
        InvalidCommandError: Somebody has to say so, and nobody is here.
    """

    def __init__(self, profile: Profile, printing: Printing, *, is_ready: bool = False, sends: bool) -> None:
        self._is_asked = sends and not is_ready and not profile.says_when_ready
        if self._is_asked and (printing.json or not (sys.stdin.isatty() and sys.stderr.isatty())):
            raise InvalidCommandError(
                f"with {profile.synchronization} the control does not say when RECV is pressed, and nobody is at a "
                "terminal to say it; what is sent before is lost",
                hint="press RECV, then say --ready; or set the control to DC CODES or XMODEM (Setting 14)",
            )

    def ask(self, view: TransferView) -> Awaitable[None] | None:
        """Return what ends when Enter is pressed; None where the control says by itself that it is ready."""
        if not self._is_asked:
            return None
        self._is_asked = False  # what is read back begins by itself
        return self._entered(view)

    @staticmethod
    async def _entered(view: TransferView) -> None:
        pressed: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def take(key: str) -> None:
            if key == "interrupt":
                view.clear()
                signal.raise_signal(signal.SIGINT)
            elif key in _ENTER and not pressed.done():
                pressed.set_result(None)

        try:
            with keys_pressed(take, lambda: signal.raise_signal(_HUNG_UP)):
                view.ask("; then press Enter here")  # which is heard from now on
                await pressed
        finally:
            view.ask("")

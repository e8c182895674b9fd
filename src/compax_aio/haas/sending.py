"""A file sent: checked before a byte of it goes, written as the control takes it, and looked at again if wanted."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from ..errors import InvalidCommandError
from ..motion.events import DriveEvent
from .line import ControlLine
from .manners import Manner
from .preparing import Prepared
from .receiving import read_file
from .reports import with_account
from .transfer import Kind, Sent
from .transferring import Transferring
from .transfers.account import LineAccount
from .verifying import Verified, only_on_screen, verified_sent

__all__ = ["Sending"]

_RESET_FIRST: Final = "; press RESET first: the file before was not sent to its end, and it may wait for the rest"
_REST: Final = (
    "the file before was not sent to its end: unless RESET was pressed at the control since, it has taken this one for "
    "the rest of that one; look at what it has stored"
)
_BACK: Final = ", which sends back what was stored, to be compared"


class Sending(Transferring[Sent]):
    """
    Sends one file.

    Args:
        line: Of the control.
        kind: What it is.
        manner: How it is wanted.
        prepare: Makes it ready, in a thread; raises InvalidCommandError if it may not be sent.
        publish: Is told what happens.
        after: See :class:`Transferring`.
    """

    def __init__(
        self,
        line: ControlLine,
        kind: Kind,
        manner: Manner,
        *,
        prepare: Callable[[], Prepared],
        publish: Callable[[DriveEvent], None],
        after: asyncio.Task[None] | None,
    ) -> None:
        super().__init__(line, kind, "send", manner, publish=publish, after=after)
        self._prepare = prepare

    async def _carry_out(self) -> Sent:
        try:
            prepared = await asyncio.to_thread(self._prepare)
        except InvalidCommandError as error:
            error.device = self._line.name
            raise with_account(error, self.account()) from None
        except OSError as error:
            raise self._reports.unreadable(error, self.account()) from error
        self._total_bytes = len(prepared.data)
        strategy = self._line.sender(f"send {self.kind}", prepared.data, self._patience, kind=self.kind)
        may_be_rest = self._line.may_wait_for_rest
        answer = self._ask_operator(sends=True, why=_RESET_FIRST if may_be_rest else "")
        if answer is not None and not self._line.profile.says_when_ready:
            await self._until_done_there(answer)
        on_line = await self._transfer(strategy)
        self._on_line = on_line
        self._note_not_held()
        held_s = self._held_s
        verified = await self._verify(prepared) if self._manner.verify else None
        proof = strategy.proof or "left the line"
        return Sent(
            control=self._line.name,
            kind=self.kind,
            bytes=on_line.bytes,
            blocks=on_line.blocks,
            lines=on_line.lines,
            proof="read back equal" if verified else proof,
            only_on_screen=only_on_screen(self.kind, is_read_back=verified is not None),
            bytes_after_xoff=on_line.held_bytes,
            held_s=held_s,
            verified=verified,
            duration_s=self._loop.time() - self._began_at,
            warnings=(*prepared.warnings, *self._warnings(on_line, proof, may_be_rest=may_be_rest and not verified)),
        )

    def _warnings(self, on_line: LineAccount, proof: str, *, may_be_rest: bool) -> tuple[str, ...]:
        warnings = [_REST] if may_be_rest else []
        if self._line.profile.synchronization == "dc codes" and proof != "reader off seen":
            warnings.append("the control has not said that it has read the last % (DC3): look at its screen")
        if on_line.detail:
            warnings.append(f"{on_line.detail}: look at its screen whether it has read anything")
        if count := on_line.held_bytes:
            warnings.append(
                f"{count} {'byte' if count == 1 else 'bytes'} left after the control had said stop, at most "
                f"{on_line.most_held_bytes} at once"
            )
        return tuple(warnings)

    # Reading back ---------------------------------------------------------------------------------------------------

    async def _verify(self, prepared: Prepared) -> Verified:
        self._is_verifying = True
        back, on_line = await self._receive_back()
        try:
            file, _ = await asyncio.to_thread(read_file, back, self.kind, self._line.profile)
        except InvalidCommandError as error:
            raise self._reports.unlike(error, self.account()) from error
        verified = await asyncio.to_thread(verified_sent, prepared.file, file)
        if not verified or not on_line.is_closed:
            why = verified.proves if not verified else "it does not end with %, so something may be missing"
            unequal = self._reports.unequal(
                f"what the control sends back is not what was sent: {why}",
                self.account(),
                "was the same one chosen? Look at the alarms: a damaged block is stored as a comment; then send it "
                "again",
            )
            unequal.verified = verified  # type: ignore[attr-defined]
            raise unequal
        return verified

    async def _receive_back(self) -> tuple[bytes, LineAccount]:
        data = bytearray()
        strategy = self._line.receiver(f"receive {self.kind} back", data.extend, self._patience)
        self._ask_operator(sends=False, why=_BACK)
        account = await self._transfer(strategy)
        return bytes(data), account

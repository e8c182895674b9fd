"""A file received: listened for, kept on disk while it comes, looked at for damage and for being what was asked for."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from ..errors import InvalidCommandError
from ..motion.events import DriveEvent
from ..severity import Severity
from ..text_file import name_of
from .archive import Archive
from .checking import check_data_file, has_text_behind
from .facts.characters import TEXT
from .facts.data_files import DataKind
from .language.data_file import DataFile, parse_data_file
from .language.program_file import ProgramFile, parse_program_file
from .line import ControlLine
from .manners import ReceivingManner
from .profiles import Profile
from .transfer import Damage, Kind, Received
from .transferring import Transferring
from .transfers.account import LineAccount
from .verifying import Verified, verified_received

__all__ = ["Receiving", "read_file"]

_AGAIN: Final = " once more, to be compared"
_MOST_ODD_BYTES: Final = 10_000


class Receiving(Transferring[Received]):
    """
    Receives one file.

    Args:
        line: Of the control.
        kind: What is expected.
        manner: How it is wanted.
        publish: Is told what happens.
        after: See :class:`Transferring`.

    Raises:
        InvalidCommandError: The archive can be no path.
    """

    def __init__(
        self,
        line: ControlLine,
        kind: Kind,
        manner: ReceivingManner,
        *,
        publish: Callable[[DriveEvent], None],
        after: asyncio.Task[None] | None,
    ) -> None:
        archive = None if manner.archive is None else Archive(manner.archive, kind)
        super().__init__(line, kind, "receive", manner, publish=publish, after=after)
        self._archive = archive
        self._file_data = bytearray()
        """What has come, the first time."""
        self._accepts_damage = manner.accept_damaged

    async def _carry_out(self) -> Received:
        if self._archive is not None:
            try:
                await self._archive.open()
            except InvalidCommandError as error:
                error.device = self._line.name
                raise
            except OSError as error:
                raise self._reports.no_archive(error, self.account()) from error
        data, on_line = await self._receive()
        self._on_line = on_line
        damage = self._damage_of(on_line)
        self._refuse_damage(damage, on_line)
        file, warnings = await self._read(data)
        verified = await self._verify(file) if self._manner.verify else None
        place = None
        if self._archive is not None:
            try:
                place = await self._archive.finish(len(data), name_of_file(file))
            except OSError as error:
                raise self._reports.unwritten(error, data, self.account()) from error
        self._file_data.clear()
        return Received(
            control=self._line.name,
            kind=self.kind,
            data=data,
            file=file,
            proof=self._proof_of(on_line),
            damage=damage,
            verified=verified,
            archive=place,
            duration_s=self._loop.time() - self._began_at,
            warnings=(*warnings, *self._warnings(on_line)),
        )

    def _came(self) -> bytes:
        return bytes(self._file_data)

    async def _receive(self, why: str = "") -> tuple[bytes, LineAccount]:
        data = bytearray() if self._is_verifying else self._file_data
        archive = None if self._is_verifying else self._archive

        def take(piece: bytes) -> None:
            data.extend(piece)
            if archive is not None:
                archive.write(piece)
            self.transfer.note_change()

        strategy = self._line.receiver(f"receive {self.kind}{why}", take, self._patience)
        self._ask_operator(sends=False, why=why)
        account = await self._transfer(strategy)
        return bytes(data), account

    # What came ------------------------------------------------------------------------------------------------------

    def _damage_of(self, on_line: LineAccount) -> Damage | None:
        counted = self._line.counted
        damage = Damage(places=on_line.damage_offsets, bytes=on_line.damaged_bytes, counted=counted)
        return damage if damage or counted is not None or self._line.tells_damage else None

    def _refuse_damage(self, damage: Damage | None, on_line: LineAccount) -> None:
        if self._accepts_damage:
            return
        if damage:
            raise self._reports.damaged(damage, self.account())
        if not on_line.is_closed:
            why = on_line.detail or "it does not end with %, so something may be missing"
            raise self._reports.unlike(why, self.account())

    async def _read(self, data: bytes) -> tuple[ProgramFile | DataFile, tuple[str, ...]]:
        try:
            return await asyncio.to_thread(read_file, data, self.kind, self._line.profile)
        except InvalidCommandError as error:
            raise self._reports.unlike(error, self.account()) from error

    async def _verify(self, file: ProgramFile | DataFile) -> Verified:
        self._is_verifying = True
        data, on_line = await self._receive(_AGAIN)
        self._refuse_damage(self._damage_of(on_line), on_line)
        again, _ = await self._read(data)
        verified = await asyncio.to_thread(verified_received, file.payload, again.payload)
        if not verified:
            error = self._reports.unequal(
                f"the {self.kind} came twice, and not the same: {verified.proves}",
                self.account(),
                "one of them is damaged, or it was changed meanwhile: is the line disturbed? Receive it again",
            )
            error.verified = verified  # type: ignore[attr-defined]
            raise error
        return verified

    def _warnings(self, on_line: LineAccount) -> tuple[str, ...]:
        warnings = []
        if count := on_line.signs_inside:
            warnings.append(
                f"{count} {'sign' if count == 1 else 'signs'} (NUL, DEL, DC1 to DC4) came inside the file, first at "
                f"offset {on_line.sign_offsets[0]}, and {'was' if count == 1 else 'were'} left out: if the line is "
                "disturbed, a character is missing there; receive it twice (verify)"
            )
        if self._line.profile.synchronization == "dc codes" and not on_line.has_dc4:
            warnings.append("the control has not said that this was all (DC4): its end is known by silence behind a %")
        if self._archive is not None and self._archive.avoided is not None:
            warnings.append(
                f"{name_of(self._archive.avoided)} has come, or was changed, meanwhile, and was left as it is: what "
                f"was received is in {name_of(self._archive.place or self._archive.avoided)}"
            )
        return tuple(warnings)

    def _proof_of(self, on_line: LineAccount) -> str:
        if on_line.blocks:
            return "xmodem EOT"
        return "DC4 seen" if on_line.has_dc4 else "silence after %"


def read_file(data: bytes, kind: Kind, profile: Profile) -> tuple[ProgramFile | DataFile, tuple[str, ...]]:
    """
    Read what came as a file of that kind; for a thread, for it may be large.

    Returns:
        It, and what is odd about it.

    Raises:
        InvalidCommandError: It is none of that kind.
    """
    if kind in {"program", "programs"}:
        return _programs(data, kind, profile)
    file = parse_data_file(data, DataKind(kind), eob=profile.eob)
    behind = _behind(file.tail)  # of what came it is a warning, of what is to be sent an error
    whole = parse_data_file(file.lead_in + file.payload, file.kind, eob=profile.eob) if behind else file
    problems = check_data_file(whole)
    for each in problems:
        if each.severity is Severity.ERROR:
            raise InvalidCommandError(each.what, hint=each.hint)
    return file, (*(str(each) for each in problems), *behind)


def _programs(data: bytes, kind: Kind, profile: Profile) -> tuple[ProgramFile, tuple[str, ...]]:
    file = parse_program_file(data, eob=profile.eob)
    if not file.numbers:
        raise InvalidCommandError("there is no program with a name in it")
    warnings = []
    if kind == "program" and len(file.programs) > 1:
        warnings.append(f"{len(file.programs)} programs came, and one was expected: was ALL chosen at the control?")
    if odd := file.payload.translate(None, TEXT):
        said = ", ".join(f"{each:02X}" for each in sorted(set(odd[:_MOST_ODD_BYTES]))[:10])
        warnings.append(
            f"{len(odd)} bytes in it are no text of a program: {said} (hexadecimal); is the line disturbed?"
        )
    if len(file.percent_lines) > 2:  # one pair
        warnings.append("there are several pairs of % in it: to send it back, they must be one")
    return file, (*warnings, *_behind(file.tail))


def _behind(tail: bytes) -> tuple[str, ...]:
    """Say that more came than what ends with ``%``."""
    if not has_text_behind(tail):
        return ()
    return (f"{len(tail)} bytes came behind the last %, and are no part of it: to send it back, take them out",)


def name_of_file(file: ProgramFile | DataFile) -> str | None:
    """Return what a file is called in a folder; None: by its kind."""
    if isinstance(file, ProgramFile) and len(file.programs) == 1 and file.numbers:
        return f"O{file.numbers[0]:05d}"
    return None

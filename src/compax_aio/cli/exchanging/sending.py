"""``compax haas send``: files checked, sent when RECV is pressed, and what of that is proved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final

from cyclopts import Parameter

from compax_aio import InvalidCommandError
from compax_aio.haas.control import Control
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.transfer import Sent, Transfer

from ..confirming import answer_to, confirm, expect_somebody
from ..exit_codes import OK
from ..half_way import Yes
from ..interruption import say_at_end
from ..printing import Printing
from ..problems import told
from .conducting import Conductor, OnOperator
from .files import ControlFile, KindOption, NamedFile, read_file
from .line import ControlLine, ControlUrl, SetUp
from .operator import Operator, Ready
from .problems import Meant, expect_sound, problems_of
from .view import written_time

__all__ = ["send"]

_NOT_WANTED: Final = 1
_TYPED: Final = "PARAMETERS"
_DANGER: Final = (
    "Parameters take effect although the control raises an alarm on them, and wrong ones can damage the machine."
)

TakeEffect = Annotated[
    bool,
    Parameter(
        name="--i-know-parameters-take-effect",
        negative=(),
        help="Needed for parameters: they are loaded in spite of an alarm, and wrong ones can damage the machine.",
    ),
]


async def send(
    url: ControlUrl,
    *files: ControlFile,
    kind: KindOption = None,
    verify: Annotated[
        bool, Parameter(negative=(), help="Have the control send it back, and compare: SEND is pressed there then.")
    ] = False,
    ready: Ready = False,
    i_know_parameters_take_effect: TakeEffect = False,
    yes: Yes = False,
    meant: Meant = Meant(),  # noqa: B008 - it is frozen
    set_up: SetUp = SetUp(),  # noqa: B008 - it is frozen
    line: ControlLine = ControlLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Send programs, or one file of numbered data, to a control whose RECV is pressed.

    Files are checked first; several programs go in one transfer, between one pair of %. At the end it is said what is
    proved, and what only the control's screen shows: sent is not stored. Only --verify proves that it is stored.
    Ctrl-C ends a transfer: nothing more of it leaves, and what the control has taken stays there. Nothing is sent
    twice, and a transfer whose line was lost is not gone on with.

    ```sh
    compax haas send serial:///dev/ttyUSB0 O01234.nc
    compax haas send serial:///dev/ttyUSB0 O01234.nc --verify --profile classic-xmodem
    compax haas send serial:///dev/ttyUSB0 "offsets 2024-05-01.txt"
    compax haas send serial:///dev/ttyUSB0 surface.nc --dnc --profile classic-dc-codes
    ```
    """
    profile = set_up.known()
    read = [read_file(each, "program" if meant.dnc and kind is None else kind) for each in files]
    what = _what(read, meant, verify=verify, knows=i_know_parameters_take_effect)
    expect_somebody(yes=yes or not _is_asked_about(what))
    problems = [(each, problems_of(each, profile, meant)) for each in read]
    for each, found in problems:
        expect_sound(each, found)
        if found:
            printing.note(str(told(each.name, found)).rstrip())
    if not await _is_wanted(what, read, url, yes=yes):
        printing.note("Nothing was sent.")
        return _NOT_WANTED
    conductor = Conductor(printing, Operator(profile, printing, is_ready=ready, sends=True))
    title = ", ".join(each.name for each in read)
    with conductor.telling():
        async with line.open(url, profile) as control:
            sent = await conductor.carry_out(
                title,
                lambda on_operator: _begin(control, what, read, meant, on_operator, verify=verify),
            )
            say_at_end(f"Interrupted. {title}: all of it was sent already; {sent.proof}.")
    _tell_sent(title, sent, conductor.took_s, printing)
    return OK


def _what(files: Sequence[NamedFile], meant: Meant, *, verify: bool, knows: bool) -> str:
    """
    Return what is sent: ``program``, ``programs``, ``drip feed`` or a kind of data.

    Raises:
        InvalidCommandError: That cannot go in one transfer, or it was not said that it is meant.
    """
    if not files:
        raise InvalidCommandError("no file was named", hint="name one, or several programs")
    kinds = {each.expect_kind() for each in files}
    if len(files) > 1 and kinds != {"program"}:
        raise InvalidCommandError(
            "numbered data go alone, one file in a transfer",
            hint="send one file after the other, RECV pressed for each",
        )
    (only,) = kinds
    if meant.dnc:
        if len(files) > 1 or only != "program":
            raise InvalidCommandError("one program alone is fed by DNC")
        if verify:
            raise InvalidCommandError("what is fed by DNC is not stored, and cannot be read back", hint="no --verify")
        return "drip feed"
    if only == "parameters" and not knows:
        raise InvalidCommandError(
            "parameters are not sent unless it is said that this is meant",
            hint=f"{_DANGER} If they are of this very control, as it has sent them: --i-know-parameters-take-effect",
        )
    if only == "program":
        count = len(files) if len(files) > 1 else len(parse_program_file(files[0].data).programs)
        return "programs" if count > 1 else "program"
    return only


def _is_asked_about(what: str) -> bool:
    return what in {"parameters", "drip feed"}


async def _is_wanted(what: str, files: Sequence[NamedFile], url: str, *, yes: bool) -> bool:
    """Ask before what is dangerous."""
    if yes or not _is_asked_about(what):
        return True
    name = files[0].name
    if what == "drip feed":
        return await confirm(f"The machine at {url} runs {name} while it comes. Is it set up, and clear?")
    typed = await answer_to(f"{_DANGER} To send {name} to {url}, type {_TYPED}:")
    return typed == _TYPED


def _begin(
    control: Control,
    what: str,
    files: Sequence[NamedFile],
    meant: Meant,
    on_operator: OnOperator,
    *,
    verify: bool,
) -> Transfer[Sent]:
    if what == "drip feed":
        return control.drip_feed(files[0].data, semicolons=meant.semicolons, on_operator=on_operator)
    how: dict[str, Any] = {"verify": verify, "on_operator": on_operator}
    data = files[0].data
    begins: dict[str, Callable[[], Transfer[Sent]]] = {
        "program": lambda: control.send_program(data, protected=meant.protected, semicolons=meant.semicolons, **how),
        "programs": lambda: control.send_programs(
            [each.data for each in files], protected=meant.protected, semicolons=meant.semicolons, **how
        ),
        "parameters": lambda: control.send_parameters(data, i_know_it_takes_effect=True, **how),
        "settings": lambda: control.send_settings(data, **how),
        "offsets": lambda: control.send_offsets(data, **how),
        "macros": lambda: control.send_macros(data, force=meant.without_n9999, **how),
    }
    return begins[what]()


def _tell_sent(title: str, sent: Sent, took_s: float, printing: Printing) -> None:
    verb = "sent and read back" if sent.verified is not None else "fed" if sent.kind == "drip feed" else "sent"
    blocks = f" in {sent.blocks:,} blocks" if sent.blocks else ""
    held = f"; the control held the line for {written_time(sent.held_s)}" if sent.held_s else ""
    proved = sent.proof if sent.verified is None else f"{sent.proof}: {sent.verified.proves}"
    printing.show(
        {"file": title, "sent": sent},
        f"{title}: {verb}, {sent.bytes:,} bytes{blocks} in {written_time(took_s)}{held}\n"
        f"  proved: {proved}\n"
        f"  only its screen shows: {sent.only_on_screen}",
    )
    for warning in sent.warnings:
        printing.note(f"{title}: {warning}")

"""``compax sim``: simulated devices on pseudo-terminals or TCP, with knobs and faults."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AsyncExitStack, ExitStack, suppress
from typing import Annotated

from cyclopts import App, Parameter
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from compax_aio.errors import InvalidCommandError
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.knob_descriptions import describe_knobs
from compax_aio.simulator.planned_faults import ANY_CODE, FAULT_KINDS

from .exit_codes import OK
from .interruption import moves_nothing
from .printing import Printing
from .simulating.devices import KINDS, Device, Faults, Place, made
from .simulating.hands import Hands
from .simulating.prompt import listen, pasted_above_prompt
from .simulating.view import SimView

__all__ = ["app"]

app = App(
    name="sim",
    help="""\
Serve simulated devices on pseudo-terminals or TCP, for programs to be tried without a machine.

They are served until Ctrl-C. What they receive, answer and do is shown as it happens. Type `help` while they are
served: you are the machine, and can fall silent, lose power, or pull out the cable. Scripts write the same words to the
standard input, and read `--json`.
""",
)

KnobWords = Annotated[str, Parameter(help="KNOB=VALUE …; `compax sim knobs` lists them.")]
Quiet = Annotated[bool, Parameter(negative=(), help="Do not show what the far end sees.")]


def _serving(kind: str, what: str) -> Callable[..., Awaitable[int]]:
    """Return the command that serves devices of that kind; *what* is its help."""

    async def serve(
        *knobs: KnobWords,
        quiet: Quiet = False,
        place: Place = Place(),  # noqa: B008 - it is frozen
        faults: Faults = Faults(),  # noqa: B008 - it is frozen
        printing: Printing = Printing(),  # noqa: B008 - it is frozen
    ) -> int:
        devices = made(KINDS[kind], knobs, place, faults.seed)
        return await _serve(devices, place, faults, printing, is_quiet=quiet, look=KINDS[kind].look)

    serve.__doc__ = what
    app.command(moves_nothing(serve), name=kind)
    return serve


serve_compax = _serving(
    "compax",
    """
    Serve one COMPAX drive, or several.

    ```sh
    compax sim compax
    compax sim compax --link /tmp/x unit=degree baudrate=9600
    compax sim compax --tcp 4001 --count 3 --name axis
    compax sim compax --fault garbled=0.01 --fault late=0.05:300ms
    compax sim compax --fault unplug@30s+5s --fault E55@60s
    ```
    """,
)
serve_smc = _serving(
    "smc",
    """
    Serve a line of SMC stepper axes, or several lines.

    ```sh
    compax sim smc axes=XYZ baudrate=9600
    compax sim smc mode=single --tcp 4001
    ```
    """,
)
serve_camm1 = _serving(
    "camm1",
    """
    Serve a CAMM-1 cutter, or several.

    Type `pause`, `setup`, `cancel`, `view` or `lever up` to press the keys of its panel.

    ```sh
    compax sim camm1 baudrate=9600
    compax sim camm1 model=PNC-900 physical_size=256 --link /tmp/cutter
    ```
    """,
)
serve_haas = _serving(
    "haas",
    """
    Serve a Haas CNC control, or several.

    Type `send O00010`, `send ALL`, `recv`, `recv settings`, `dnc`, `cycle start`, `dprnt TEXT` or `reset` to press its
    keys; `memory`, `alarms` and `where` show what only its screen shows.

    ```sh
    compax sim haas baudrate=9600
    compax sim haas profile=dc_codes baudrate=9600 --link /tmp/mill
    compax sim haas press=send:O00010,recv press_again=1 --tcp 4001
    ```
    """,
)


async def _serve(
    devices: dict[str, Device], place: Place, faults: Faults, printing: Printing, *, is_quiet: bool, look: str
) -> int:
    """Serve *devices*, at which the command *look* looks, until somebody ends it; returns the exit code."""
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    view = SimView(printing, is_quiet=is_quiet, began_at=loop.time(), on_failure=task.cancel)
    far_ends: dict[str, FarEnd] = {}
    for number, (name, device) in enumerate(devices.items()):

        def say(text: str, name: str = name) -> None:
            view.befell(name, loop.time(), text)

        far_ends[name] = faults.on(device, place.outlet(device, number), say)
    with ExitStack() as around:
        around.enter_context(place.kept_state(devices))
        is_conversation = around.enter_context(pasted_above_prompt(wanted=not printing.json))
        async with AsyncExitStack() as serving:
            urls = {name: await serving.enter_async_context(each.served()) for name, each in far_ends.items()}
            _show_urls(urls, place, printing, is_conversation=is_conversation, look=look)
            view.watch(devices)
            for each in far_ends.values():
                each.start_timetable()
            with suppress(asyncio.CancelledError):  # Ctrl-C is how service ends
                await _until_end(Hands(far_ends), printing, is_conversation=is_conversation)
    if view.failure is not None:
        raise view.failure
    printing.note("No device is served any more." if place.state is None else f"The state is in {place.state}.")
    return OK


def _show_urls(urls: Mapping[str, str], place: Place, printing: Printing, *, is_conversation: bool, look: str) -> None:
    width = max(map(len, urls))
    printing.show({"urls": urls}, "\n".join(f"{name:{width}}  {url}" for name, url in urls.items()))
    if place.host not in {"127.0.0.1", "::1", "localhost"} and place.tcp is not None:
        printing.note(f"Whoever reaches {place.host} can talk to these devices: there is no password on such a line.")
    ending = "type help, or Ctrl-C to end" if is_conversation else "Ctrl-C ends"
    printing.note(f"Try `compax {look} {next(iter(urls.values()))}` in another terminal; {ending}.")


async def _until_end(hands: Hands, printing: Printing, *, is_conversation: bool) -> None:
    await listen(hands, lambda text: printing.show({"said": text}, text), is_conversation=is_conversation)
    if not hands.wants_end:
        await asyncio.Event().wait()


@app.command
@moves_nothing
def knobs(
    kind: Annotated[str, Parameter(help="compax, smc, camm1 or haas")],
    *,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    List all knobs of a kind of device, with their defaults and what they do.

    ```sh
    compax sim knobs compax
    compax sim knobs smc
    compax sim knobs camm1
    compax sim knobs haas
    ```
    """
    if kind not in KINDS:
        raise InvalidCommandError(f"there is no simulated {kind!r}", hint=f"there are {', '.join(KINDS)}")
    described = describe_knobs(KINDS[kind].knobs)
    rows: list[RenderableType] = []
    for each in described:
        rows.append(Text.assemble((f"{each.name}={each.default}", "bold"), (f"   {each.values}", "dim")))
        rows.append(Padding(Text(each.meaning), (0, 0, 0, 4)))
    printing.show(described, Group(*rows))


@app.command(name="faults")
@moves_nothing
def list_faults(
    *,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    List what can go wrong, and how `--fault` orders it.

    NAME[=CHANCE][:AMOUNT][@START[+SPAN]]: a chance from 0 to 1, for each byte or each command; how much or how long;
    when it begins, from the beginning of service on, and how long it goes on. Times are 300ms, 5s, 2min.

    ```sh
    compax sim compax --fault lost=0.001
    compax sim compax --fault unplug=0.01:2s@30s+60s
    compax sim compax --fault power@20s+1s
    ```

    The first loses one byte in a thousand, all the time. The second pulls out the cable for two seconds after one
    command in a hundred, from 30 s on and for a minute. The third takes the power away once, for a second.
    """
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("fault", "chance is per", "amount", "what happens"):
        table.add_column(heading)
    kinds = (*FAULT_KINDS, ANY_CODE)
    for each in kinds:
        amount = "" if each.amount_s is None else f"{each.amount_s:g} s"
        table.add_row(each.name, each.chance_is_per, amount, each.meaning)
    printing.show(
        [
            {"name": each.name, "chance_is_per": each.chance_is_per, "amount_s": each.amount_s, "meaning": each.meaning}
            for each in kinds
        ],
        table,
    )

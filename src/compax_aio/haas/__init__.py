r"""
Exchange programs and data with Haas CNC controls over a serial line, and read what the machine does.

.. code-block:: python

    import compax_aio.haas as haas

    async with haas.connect("serial:///dev/ttyUSB0", profile=haas.CLASSIC_DC_CODES) as control:
        received = await control.receive_program(archive="programs/", on_operator=print)  # press SEND at the control
        for problem in haas.check_program(received.data, control.profile):
            print(problem)
        sent = await control.send_program("O01234\nG90 G0 X0\nM30", verify=True, on_operator=print)  # RECV, then SEND
        print(sent.proof, "-", sent.only_on_screen)
        print(await control.serial_number(), await control.variable(3027))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from ..severity import Severity
    from .answers import (
        Answer,
        Busy,
        Count,
        Duration,
        Mode,
        ProgramStatus,
        Text,
        VariableValue,
        Written,
    )
    from .checking import check_data_file, check_program
    from .comparing import Difference, ProgramDifference, compare_data, diff, first_difference, same_program
    from .connecting import connect
    from .control import Control
    from .events import (
        DripFeedHeld,
        Overheard,
        Printed,
        ReaderOff,
        ReaderOn,
        TransferBegun,
        TransferEnded,
        VariableWritten,
    )
    from .facts.data_files import DataKind
    from .language.building import build_program_file
    from .language.data_file import DataFile, DataLine, parse_data_file
    from .language.program_file import Block, Program, ProgramFile, parse_program_file
    from .manners import HowToReceive, HowToSend
    from .problems import Problem, raise_for_errors
    from .profiles import (
        CLASSIC,
        CLASSIC_DC_CODES,
        CLASSIC_RTS_CTS,
        CLASSIC_XMODEM,
        DATA_COLLECTION,
        DATA_COLLECTION_19200,
        DATA_COLLECTION_115200,
        NEXT_GENERATION,
        PROFILES,
        Profile,
        profile_named,
    )
    from .settings import ControlSettings
    from .transfer import Damage, Received, Sent, Transfer, TransferAccount, TransferProgress
    from .verifying import Verified
    from .watching import Reading, Watch

__all__ = [
    "CLASSIC",
    "CLASSIC_DC_CODES",
    "CLASSIC_RTS_CTS",
    "CLASSIC_XMODEM",
    "DATA_COLLECTION",
    "DATA_COLLECTION_19200",
    "DATA_COLLECTION_115200",
    "NEXT_GENERATION",
    "PROFILES",
    "Answer",
    "Block",
    "Busy",
    "Control",
    "ControlSettings",
    "Count",
    "Damage",
    "DataFile",
    "DataKind",
    "DataLine",
    "Difference",
    "DripFeedHeld",
    "Duration",
    "HowToReceive",
    "HowToSend",
    "Mode",
    "Overheard",
    "Printed",
    "Problem",
    "Profile",
    "Program",
    "ProgramDifference",
    "ProgramFile",
    "ProgramStatus",
    "ReaderOff",
    "ReaderOn",
    "Reading",
    "Received",
    "Sent",
    "Severity",
    "Text",
    "Transfer",
    "TransferAccount",
    "TransferBegun",
    "TransferEnded",
    "TransferProgress",
    "VariableValue",
    "VariableWritten",
    "Verified",
    "Watch",
    "Written",
    "build_program_file",
    "check_data_file",
    "check_program",
    "compare_data",
    "connect",
    "diff",
    "first_difference",
    "parse_data_file",
    "parse_program_file",
    "profile_named",
    "raise_for_errors",
    "same_program",
]

_HOMES: Final[dict[str, tuple[str, ...]]] = {
    "..severity": ("Severity",),
    ".answers": (
        "Answer", "Busy", "Count", "Duration", "Mode", "ProgramStatus", "Text", "VariableValue", "Written",
    ),
    ".checking": ("check_data_file", "check_program"),
    ".comparing": (
        "Difference", "ProgramDifference", "compare_data", "diff", "first_difference", "same_program",
    ),
    ".connecting": ("connect",),
    ".control": ("Control",),
    ".events": (
        "DripFeedHeld", "Overheard", "Printed", "ReaderOff", "ReaderOn", "TransferBegun", "TransferEnded",
        "VariableWritten",
    ),
    ".facts.data_files": ("DataKind",),
    ".language.building": ("build_program_file",),
    ".language.data_file": ("DataFile", "DataLine", "parse_data_file"),
    ".language.program_file": ("Block", "Program", "ProgramFile", "parse_program_file"),
    ".manners": ("HowToReceive", "HowToSend"),
    ".problems": ("Problem", "raise_for_errors"),
    ".profiles": (
        "CLASSIC", "CLASSIC_DC_CODES", "CLASSIC_RTS_CTS", "CLASSIC_XMODEM", "DATA_COLLECTION", "DATA_COLLECTION_115200",
        "DATA_COLLECTION_19200", "NEXT_GENERATION", "PROFILES", "Profile", "profile_named",
    ),
    ".settings": ("ControlSettings",),
    ".transfer": ("Damage", "Received", "Sent", "Transfer", "TransferAccount", "TransferProgress"),
    ".verifying": ("Verified",),
    ".watching": ("Reading", "Watch"),
}  # fmt: skip
"""Where each name is, never in a module of that name; new names go here, in __all__, and above."""


def __getattr__(name: str) -> Any:
    # Whoever wants no more than the facts, as a simulator does, gets no client with them.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

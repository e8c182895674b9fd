"""Diagrams of the states of each line, drawn from its table of transitions when the documents are built."""

from __future__ import annotations

from typing import ClassVar, Final

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx
from state_drawing import Diagram, Route, svg

from compax_aio.camm1 import protocol_states as camm1
from compax_aio.compax import protocol_states as compax
from compax_aio.haas import protocol_states as haas
from compax_aio.smc import protocol_states as smc

__all__ = ["CAMM1", "COMPAX", "DIAGRAMS", "HAAS", "SMC", "setup"]

_C = compax.State
COMPAX: Final = Diagram(
    title="The states of a COMPAX line",
    table=compax.TRANSITIONS,
    doubtful=compax.DOUBTFUL,
    word=lambda event: event.__name__.lstrip("_"),
    size=(860, 650),
    places={
        _C.READY: (292, 60),
        _C.AWAITING_FRAME: (682, 60),
        _C.AWAITING_ANSWER: (84, 230),
        _C.AWAITING_MARKER: (488, 230),
        _C.IN_DOUBT: (292, 400),
        _C.FRAME_IN_DOUBT: (682, 400),
        _C.AWAITING_AHEAD: (292, 570),
        _C.AWAITING_STOP: (682, 570),
    },
    loops={_C.IN_DOUBT: (-1, 0), _C.AWAITING_MARKER: (0, -1), _C.FRAME_IN_DOUBT: (1, 0)},
    routes={(_C.AWAITING_AHEAD, _C.READY): Route(via=((8, 570), (8, 60)), label_at=2)},
)

_S = smc.State
SMC: Final = Diagram(
    title="The states of an SMC line",
    table=smc.TRANSITIONS,
    doubtful=smc.DOUBTFUL,
    word=lambda event: event.value,
    size=(856, 670),
    places={
        _S.HALF_TYPED: (416, 50),
        _S.CLEARING: (153, 190),
        _S.PROBING: (153, 350),
        _S.PROBE_ENDING: (153, 490),
        _S.IN_DOUBT: (416, 350),
        _S.READY: (416, 630),
        _S.TYPING: (690, 190),
        _S.ENDING: (690, 350),
        _S.LISTING: (690, 490),
    },
    loops={_S.CLEARING: (1, 0), _S.PROBING: (-1, 0), _S.TYPING: (0, -1)},
    routes={
        (_S.CLEARING, _S.READY): Route(via=((8, 190), (8, 630)), label_at=2),
        (_S.READY, _S.TYPING): Route(via=((846, 640), (846, 190))),
        (_S.ENDING, _S.READY): Route(via=((820, 350), (820, 620)), label_at=2),
    },
    anywhere={_S.IN_DOUBT: (416, 196), _S.CLEARING: (153, 50)},
)


_K = camm1.State
CAMM1: Final = Diagram(
    title="The states of a cutter's line",
    table=camm1.TRANSITIONS,
    doubtful=camm1.DOUBTFUL,
    word=lambda event: event.value,
    size=(960, 690),
    places={
        _K.SETTLING: (345, 50),
        _K.IN_DOUBT: (345, 170),
        _K.PROBING: (75, 510),
        _K.DRAINING: (205, 320),
        _K.SIGNING: (345, 660),
        _K.ASKING: (455, 375),
        _K.READY: (630, 660),
        _K.WITHDRAWING: (630, 275),
        _K.QUESTIONING: (845, 160),
        _K.BURSTING: (845, 480),
        _K.ENDING: (845, 660),
    },
    routes={
        (_K.PROBING, _K.IN_DOUBT): Route(via=((20, 170),)),
        (_K.PROBING, _K.SIGNING): Route(via=((75, 666),), label_at=1),
        (_K.DRAINING, _K.SIGNING): Route(via=((235, 652),)),
        (_K.ASKING, _K.IN_DOUBT): Route(via=((397, 280),)),
        (_K.WITHDRAWING, _K.IN_DOUBT): Route(via=((600, 180),)),
        (_K.QUESTIONING, _K.IN_DOUBT): Route(via=((600, 160),)),
    },
    anywhere={_K.SETTLING: (115, 50), _K.IN_DOUBT: (605, 50)},
)

_H = haas.State
HAAS: Final = Diagram(
    title="The states of a control's line",
    table=haas.TRANSITIONS,
    doubtful=haas.DOUBTFUL,
    word=lambda event: event.value,
    size=(860, 580),
    places={
        _H.QUIETING: (110, 170),
        _H.IN_DOUBT: (450, 170),
        _H.ASKING: (250, 310),
        _H.CATCHING_UP: (620, 310),
        _H.CALMING: (450, 430),
        _H.READY: (110, 550),
        _H.TRANSFERRING: (760, 550),
    },
    routes={(_H.TRANSFERRING, _H.IN_DOUBT): Route(via=((745, 170),))},
    anywhere={_H.QUIETING: (110, 50), _H.IN_DOUBT: (450, 50)},
)

DIAGRAMS: Final = {
    "state-diagram": COMPAX,
    "smc-state-diagram": SMC,
    "camm1-state-diagram": CAMM1,
    "haas-state-diagram": HAAS,
}
"""By the directive that puts each in place."""


class _DiagramDirective(Directive):
    diagram: ClassVar[Diagram]

    def run(self) -> list[nodes.Node]:
        """Put the picture where the directive stands; builders that make no HTML leave it out."""
        return [nodes.raw("", svg(self.diagram, self.name), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Give Sphinx a directive for each diagram."""
    for name, diagram in DIAGRAMS.items():
        app.add_directive(name, type(f"{name} directive", (_DiagramDirective,), {"diagram": diagram}))
    return {"parallel_read_safe": True}

"""Of which moves, once they have ended for whoever awaited them, nobody can say that the axis stands."""

from __future__ import annotations

from ..errors import ConnectionLostError, MoveInDoubtError
from ..motion.moves import MoveFuture

__all__ = ["may_go_on"]


def may_go_on(move: MoveFuture, *, line_is_there: bool) -> bool:
    """
    Whether *move* may go on although it has ended for us.

    It does if it is in doubt, and also if it was sent, and its line was lost for good before anybody could look.
    """
    failure = move.failure
    is_unseen = isinstance(failure, ConnectionLostError) and move.is_on_wire and not line_is_there
    return is_unseen or isinstance(failure, MoveInDoubtError)

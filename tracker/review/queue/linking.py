"""Moves: changes of the run's links between pieces of tracks, at one place."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

from tracker.corrections import Place
from tracker.review.queue.item import Alternative, ItemKind, proposed


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a track that follows one person (a tracklet)."""

    track: int
    begin: Place
    end: Place
    moment: int = -1
    """The step at which the piece is linked, if its begin or end was moved to a clear place; −1
    if it was not."""

    @property
    def last(self) -> int:
        """The last step of the piece, for one that is linked to a later piece."""
        return self.end.step if self.moment < 0 else self.moment

    @property
    def first(self) -> int:
        """The first step of the piece, for one that is linked to an earlier piece."""
        return self.begin.step if self.moment < 0 else self.moment


@dataclass(frozen=True, slots=True)
class Move:
    """A change of links at one place: instead of i → j and i' → j', i → j' and i' → j; or the
    removal or addition of one link."""

    earlier: tuple[Piece, ...]
    """i, then i' if there is one."""
    later: tuple[Piece, ...]
    """j, then j' if there is one: the pieces that i and i' are linked to in the run. For a join, j
    is a piece that has no link to an earlier one."""
    kind: ItemKind
    """The kind of change: an exchange crosses both links over, a cut removes i → j, a join adds
    i → j where both ends were free."""
    odds: float
    """The log odds of the changed links against the run's."""

    why: str = ""
    """The reason, in one sentence, if it is not the odds of the links."""

    @property
    def joins(self) -> bool:
        """Whether the move adds a link between free ends."""
        return self.kind == "join"

    def stake(self, heads: Many[float], tails: Many[float]) -> float:
        """Return the number of steps that get another identity by the move.

        Args:
            heads: The number of steps that depend on each of the earlier pieces.
            tails: The number of steps that depend on each of the later pieces.
        """
        return min(sum(heads), sum(tails))

    @property
    def alternative(self) -> Alternative:
        """The alternative that makes this move, with its probability still at 0."""
        if len(self.earlier) == 1 and len(self.later) == 1:
            i, j = self.earlier[0], self.later[0]
            if self.joins:
                return Alternative(_joined(i, j), 0.0, proposed("same", (i.end, j.begin)))
            return Alternative("two people", 0.0, proposed("different", (i.end, j.begin)))
        if len(self.earlier) == 2 and len(self.later) == 2:
            (i, other), (j, after) = self.earlier, self.later
            exchange = proposed("exchanged", (i.end, other.end, after.begin, j.begin))
            if not exchange:
                exchange = (
                    *proposed("same", (i.end, after.begin)),
                    *proposed("same", (other.end, j.begin)),
                )
            words = f"exchanged with {other.track if other.track != i.track else after.track}"
            return Alternative(words, 0.0, exchange)
        if len(self.earlier) == 2:  # i' is linked to j, and i ends
            (_, other), (j,) = self.earlier, self.later
            return Alternative(_joined(other, j), 0.0, proposed("same", (other.end, j.begin)))
        (i,), (_, after) = self.earlier, self.later
        return Alternative(_joined(i, after), 0.0, proposed("same", (i.end, after.begin)))

    @property
    def halves(self) -> tuple[Alternative, ...]:
        """For an exchange, the alternatives that make only one of its two links; else none."""
        if len(self.earlier) < 2 or len(self.later) < 2:
            return ()
        (i, other), (j, after) = self.earlier, self.later
        return tuple(
            Alternative(_joined(a, b), 0.0, proposed("same", (a.end, b.begin)))
            for a, b in ((i, after), (other, j))
        )


def _joined(i: Piece, j: Piece) -> str:
    return f"{i.track} goes on as {j.track}" if i.track != j.track else f"{i.track} goes on"

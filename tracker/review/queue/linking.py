"""Doubts about who goes on as whom: moves from one way to link pieces to another."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

from tracker.corrections import Place
from tracker.review.queue.item import Alternative, ItemKind, proposed


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a track that is one person's."""

    track: int
    begin: Place
    end: Place
    moment: int = -1
    """The step at which it begins or ends, where a place of it is said that lies elsewhere."""

    @property
    def last(self) -> int:
        """The step up to which it is one person's, of one that goes on as another."""
        return self.end.step if self.moment < 0 else self.moment

    @property
    def first(self) -> int:
        """The step from which it is one person's, of one that others go on as."""
        return self.begin.step if self.moment < 0 else self.moment


@dataclass(frozen=True, slots=True)
class Move:
    """Other links than the run's, at one place: i → j' and i' → j, or no link at all."""

    earlier: tuple[Piece, ...]
    """i, then i' where there is one."""
    later: tuple[Piece, ...]
    """What they go on as now: j, then j'; for a join those that begin anew."""
    kind: ItemKind
    """exchange: both cross over; cut: i → j no more; join: i → j where both were free."""
    odds: float
    """log of how much likelier than what the run has."""

    why: str = ""
    """In one sentence, where it is not what the odds of joining say."""

    @property
    def joins(self) -> bool:
        """Whether it links what is linked to nothing."""
        return self.kind == "join"

    def stake(self, heads: Many[float], tails: Many[float]) -> float:
        """Steps that another person's track would get.

        Args:
            heads: Steps that hang on each of the earlier.
            tails: On each of the later.
        """
        return min(sum(heads), sum(tails))

    @property
    def alternative(self) -> Alternative:
        """What somebody says who makes it; its probability is still to be found."""
        if len(self.earlier) == 1 and len(self.later) == 1:
            i, j = self.earlier[0], self.later[0]
            if self.joins:
                return Alternative(_joined(i, j), 0.0, proposed("same", (i.end, j.begin)))
            return Alternative("two people", 0.0, proposed("different", (i.end, j.begin)))
        if len(self.earlier) == 2 and len(self.later) == 2:
            (i, other), (j, after) = self.earlier, self.later
            told = proposed("exchanged", (i.end, other.end, after.begin, j.begin))
            if not told:
                told = (
                    *proposed("same", (i.end, after.begin)),
                    *proposed("same", (other.end, j.begin)),
                )
            words = f"exchanged with {other.track if other.track != i.track else after.track}"
            return Alternative(words, 0.0, told)
        if len(self.earlier) == 2:  # j goes on from i', and i ends
            (_, other), (j,) = self.earlier, self.later
            return Alternative(_joined(other, j), 0.0, proposed("same", (other.end, j.begin)))
        (i,), (_, after) = self.earlier, self.later
        return Alternative(_joined(i, after), 0.0, proposed("same", (i.end, after.begin)))

    @property
    def halves(self) -> tuple[Alternative, ...]:
        """Of an exchange what somebody says who makes only one of its two links."""
        if len(self.earlier) < 2 or len(self.later) < 2:
            return ()
        (i, other), (j, after) = self.earlier, self.later
        return tuple(
            Alternative(_joined(a, b), 0.0, proposed("same", (a.end, b.begin)))
            for a, b in ((i, after), (other, j))
        )


def _joined(i: Piece, j: Piece) -> str:
    return f"{i.track} goes on as {j.track}" if i.track != j.track else f"{i.track} goes on"

"""Moves: changes of the run's links between tracklets, at one place."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

from tracker.corrections import Place
from tracker.review.queue.item import Alternative, ItemKind, propose


@dataclass(frozen=True, slots=True)
class Tracklet:
    """A part of a track that follows one person (a tracklet)."""

    track: int
    """The id of the track."""
    begin: Place
    """The first place of the tracklet, or a clear place instead."""
    end: Place
    """The last place of the tracklet, or a clear place instead."""
    moment: int = -1
    """The step of the link, if the begin or the end of the tracklet was replaced by a clear place
    (see :mod:`tracker.review.queue.clear_places`); −1 if it was not."""

    @property
    def last(self) -> int:
        """The last step before the link to a later tracklet."""
        return self.end.step if self.moment < 0 else self.moment

    @property
    def first(self) -> int:
        """The first step after the link to an earlier tracklet."""
        return self.begin.step if self.moment < 0 else self.moment


@dataclass(frozen=True, slots=True)
class Move:
    """A change of links at one place.

    An exchange replaces i → j and i' → j' by i → j' and i' → j; the other moves remove or add one
    link. If only one of the two links of an exchange is there, ``earlier`` or ``later`` has one
    tracklet.
    """

    earlier: tuple[Tracklet, ...]
    """i, then i' if there is one."""
    later: tuple[Tracklet, ...]
    """j, then j' if there is one: the tracklets that i and i' are linked to in the run. For a join,
    j is a tracklet that has no link to an earlier one."""
    kind: ItemKind
    """The kind of change: "exchange" and "crossing" exchange the links, "cut", "gap" and "fast"
    remove i → j, and "join" adds i → j where both ends were free."""
    log_odds: float
    """The natural logarithm of the odds of the changed links against the run's."""

    why: str = ""
    """The reason for the move, in words; empty if the odds of the links are the reason."""
    title: str = ""
    """What was measured at the place, in words; empty if the odds of the links are the reason."""

    @property
    def joins(self) -> bool:
        """Whether the move adds a link between free ends."""
        return self.kind == "join"

    def stake(self, heads: Many[float], tails: Many[float]) -> float:
        """Return the number of steps whose identity the move changes.

        Either the earlier or the later tracklets keep their identity; the smaller number counts.

        Args:
            heads: The expected number of steps that have the identity of each earlier tracklet.
            tails: The expected number of steps that have the identity of each later tracklet.
        """
        return min(sum(heads), sum(tails))

    @property
    def alternative(self) -> Alternative:
        """The alternative whose corrections make this move; its probability is 0, to be
        replaced."""
        if len(self.earlier) == 1 and len(self.later) == 1:
            i, j = self.earlier[0], self.later[0]
            if self.joins:
                return Alternative(_words_of_link(i, j), 0.0, propose("same", (i.end, j.begin)))
            return Alternative("two people", 0.0, propose("different", (i.end, j.begin)))
        if len(self.earlier) == 2 and len(self.later) == 2:
            (i, other), (j, after) = self.earlier, self.later
            exchange = propose("exchanged", (i.end, other.end, after.begin, j.begin))
            if not exchange:
                exchange = (
                    *propose("same", (i.end, after.begin)),
                    *propose("same", (other.end, j.begin)),
                )
            words = f"exchanged with {other.track if other.track != i.track else after.track}"
            return Alternative(words, 0.0, exchange)
        if len(self.earlier) == 2:  # instead of i → j, i' → j; i ends
            (_, other), (j,) = self.earlier, self.later
            return Alternative(_words_of_link(other, j), 0.0, propose("same", (other.end, j.begin)))
        (i,), (_, after) = self.earlier, self.later
        return Alternative(_words_of_link(i, after), 0.0, propose("same", (i.end, after.begin)))

    @property
    def halves(self) -> tuple[Alternative, ...]:
        """For an exchange, the alternatives that make only one of its two links; else none."""
        if len(self.earlier) < 2 or len(self.later) < 2:
            return ()
        (i, other), (j, after) = self.earlier, self.later
        return tuple(
            Alternative(_words_of_link(a, b), 0.0, propose("same", (a.end, b.begin)))
            for a, b in ((i, after), (other, j))
        )


def _words_of_link(i: Tracklet, j: Tracklet) -> str:
    """Describe the link of two tracklets."""
    return f"{i.track} goes on as {j.track}" if i.track != j.track else f"{i.track} goes on"

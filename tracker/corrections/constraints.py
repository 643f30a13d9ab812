"""Constraints on who is who: on places as a user states them, on tracklets as linking has them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

Of = TypeVar("Of", bound=Hashable)
Other = TypeVar("Other", bound=Hashable)


@dataclass(frozen=True, slots=True)
class Constraints(Generic[Of]):
    """Constraints on places, or on tracklets, which are given by their indices.

    A correction states them of places (:attr:`tracker.corrections.kinds.Correction.constraints`);
    among the tracks of a run each place stands for one tracklet, and linking obeys them.
    """

    must_link: tuple[tuple[Of, Of], ...] = ()
    """Pairs of one person, the earlier first; others of that person may lie between."""
    cannot_link: tuple[tuple[Of, Of], ...] = ()
    """Pairs of two people."""
    targets: frozenset[Of] = frozenset()
    """Those that are targets for certain."""
    clutter: frozenset[Of] = frozenset()
    """Those that are false for certain."""
    firsts: frozenset[Of] = frozenset()
    """Those with which a track begins."""
    lasts: frozenset[Of] = frozenset()
    """Those with which a track ends."""

    def __bool__(self) -> bool:
        return self != Constraints()

    def mapped(self, names: Mapping[Of, Other]) -> Constraints[Other]:
        """The same constraints under other names, without what has none.

        Args:
            names: The name that stands for each of those that remain.
        """

        def pairs(of: tuple[tuple[Of, Of], ...]) -> tuple[tuple[Other, Other], ...]:
            return tuple((names[i], names[j]) for i, j in of if i in names and j in names)

        def single(of: frozenset[Of]) -> frozenset[Other]:
            return frozenset(names[i] for i in of if i in names)

        return Constraints(
            pairs(self.must_link),
            pairs(self.cannot_link),
            *map(single, (self.targets, self.clutter, self.firsts, self.lasts)),
        )

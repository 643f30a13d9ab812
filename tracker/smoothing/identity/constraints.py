"""What corrections say of pieces: which are one person's, which are not, which are nobody's."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Many
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from tracker.corrections import Correction, Place
from tracker.corrections.seeking import Whereabouts, mostly_inside
from tracker.smoothing.identity.exchanges import turn
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted

_EVER = int(np.iinfo(np.int64).max)


@dataclass(frozen=True, slots=True)
class Ties:
    """What the joining of n pieces must obey; all of it can be obeyed at once."""

    together: tuple[tuple[int, int], ...] = ()
    """Consecutive pieces of one person, the earlier first; others may lie between."""
    apart: tuple[tuple[int, int], ...] = ()
    """Pieces of two people."""
    somebody: frozenset[int] = frozenset()
    """Pieces that are somebody's for sure."""
    nobody: frozenset[int] = frozenset()
    firsts: frozenset[int] = frozenset()
    """Pieces before which their person was not there."""
    lasts: frozenset[int] = frozenset()
    """Pieces after which their person was not there."""

    def __bool__(self) -> bool:
        return bool(self.together or self.apart or self.somebody or self.nobody
                    or self.firsts or self.lasts)  # fmt: skip

    def parted(self, cut: Paths, longest: int) -> tuple[Ties, Ties]:
        """What holds for joins over short gaps, and what is left for those who were away longer.

        Args:
            cut: The pieces.
            longest: Steps of the longest gap that motion alone bridges.
        """
        near = tuple((i, j) for i, j in self.together if cut.firsts[j] - cut.lasts[i] <= longest)
        far = tuple(pair for pair in self.together if pair not in near)
        return replace(self, together=near), replace(self, together=far)

    def limits(self, chains: Many[Many[int]], cut: Paths) -> dict[int, tuple[int, int]]:
        """The first and the last step at which the people of some chains may be: who is not
        somebody else does not go on where that one begins.

        Args:
            chains: The pieces of each person.
            cut: The pieces.
        """
        number = {piece: k for k, chain in enumerate(chains) for piece in chain}
        found: dict[int, tuple[int, int]] = {}

        def limit(piece: int, first: int, last: int) -> None:
            k = number.get(piece, -1)
            if k >= 0:
                low, high = found.get(k, (0, _EVER))
                begins, ends = piece == chains[k][0], piece == chains[k][-1]
                found[k] = max(low, first if begins else 0), min(high, last if ends else high)

        for one, other in self.apart:
            i, j = (one, other) if cut.firsts[one] <= cut.firsts[other] else (other, one)
            if cut.lasts[i] < cut.firsts[j]:
                limit(i, 0, int(cut.firsts[j]) - 1)
                limit(j, int(cut.lasts[i]) + 1, _EVER)
        for piece in self.firsts:
            limit(piece, int(cut.firsts[piece]), _EVER)
        for piece in self.lasts:
            limit(piece, 0, int(cut.lasts[piece]))
        return found

    def of_chains(self, chains: Many[Many[int]], cut: Paths) -> Ties | None:
        """The same of the chains of pieces; None where two of one person's overlap in time."""
        number = {piece: k for k, chain in enumerate(chains) for piece in chain}
        told = Said(
            [(number[i], number[j]) for i, j in self.together],
            [(number[i], number[j]) for i, j in self.apart if i in number and j in number],
        )
        ends = [Said(first=number[piece]) for piece in sorted(self.firsts) if piece in number]
        ends += [Said(last=number[piece]) for piece in sorted(self.lasts) if piece in number]
        firsts = np.array([cut.firsts[chain[0]] for chain in chains], dtype=np.int64)
        lasts = np.array([cut.lasts[chain[-1]] for chain in chains], dtype=np.int64)
        return possible(firsts, lasts, [told, *ends], strict=True)


class Said(NamedTuple):
    """What one correction says of pieces."""

    together: Many[tuple[int, int]] = ()
    apart: Many[tuple[int, int]] = ()
    nobody: AbstractSet[int] = frozenset()
    first: int = -1
    """Before which its person was not there; -1 for none."""
    last: int = -1
    meant: AbstractSet[int] = frozenset()
    """All pieces that it speaks of."""
    somebody: AbstractSet[int] = frozenset()
    """Those of them that are somebody's for sure."""


class Seeker:
    """Finds whom corrections mean, among uncut paths and then among their pieces."""

    def __init__(self, fitted: Fitted, corrections: Many[Correction], leeway: int) -> None:
        """Look where everybody is.

        Args:
            fitted: The paths before they are cut.
            corrections: In their order.
            leeway: Steps within which somebody counts who is not there at the very step.
        """
        paths = fitted.paths
        self._fitted, self._corrections, self._leeway = fitted, corrections, leeway
        self._jumps = fitted.jumps if any(one.kind == "different" for one in corrections) else None
        self._steps, self._owners = paths.steps, paths.owners
        self._whereabouts = Whereabouts(self._steps, paths.states[:, :3], self._owners)
        self._rows = {
            place: self._whereabouts.nearest(place, leeway=leeway)
            for one in corrections
            if one.kind not in ("here", "nobody", "checked")
            for place in one.places
        }
        self._rows |= {
            one.places[0]: self._whereabouts.stated(one)
            for one in corrections
            if one.kind == "here"
        }
        self._inside = {
            one.id: self._whereabouts.inside(one) for one in corrections if one.kind == "nobody"
        }

    def breaks(self) -> Bool[ndarray, " N"]:
        """The rows before which a correction cuts its path.

        What a person says of two moments says nothing of when between them it happened: that is
        where it fits the lives before and after best.
        """
        found = np.zeros(len(self._steps), dtype=bool)
        for one in self._corrections:
            if one.kind == "came" and (row := self._rows[one.places[0]]) is not None:
                found[row] = True
            elif one.kind == "left" and (row := self._rows[one.places[0]]) is not None:
                if row + 1 < len(found) and self._owners[row + 1] == self._owners[row]:
                    found[row + 1] = True
            elif one.kind == "nobody":
                inside = self._inside[one.id]
                for path in mostly_inside(self._owners, self._steps, inside, one):
                    rows = np.flatnonzero(inside & (self._owners == path))
                    found[rows[0]] = True
                    if rows[-1] + 1 < len(found):
                        found[rows[-1] + 1] = True
            else:
                found[self._turns(one)] = True
        return found

    def _turns(self, one: Correction) -> list[int]:
        """Where somebody goes on as somebody else who is not the same for the paths, and where
        somebody does not go on who is."""
        found: list[int] = []
        for a, b in one.pairs:
            earlier, later = self._rows[a], self._rows[b]
            if earlier is None or later is None or self._owners[earlier] == self._owners[later]:
                continue
            before, after = [earlier], [later]
            if one.kind == "exchanged":  # both turn at once
                before, after = (
                    [row for place in some if (row := self._rows[place]) is not None]
                    for some in (one.places[:2], one.places[2:])
                )
            found += turn(
                self._fitted, int(self._owners[earlier]), int(self._owners[later]),
                int(self._steps[before].max()), int(self._steps[after].min()),
            )  # fmt: skip
        for a, b in one.apart:
            earlier, later = self._rows[a], self._rows[b]
            if earlier is None or later is None or earlier >= later or self._jumps is None:
                continue
            if one.kind == "different" and self._owners[earlier] == self._owners[later]:
                between = slice(earlier + 1, later + 1)
                found.append(earlier + 1 + int(np.argmax(self._jumps[between])))
        return found

    def meant(self, cut: Paths, kept: Int[ndarray, " M"]) -> set[int]:
        """The pieces that a correction speaks of."""
        return {piece for said in self._told(cut, kept) for piece in said.meant}

    def ties(self, cut: Paths, kept: Int[ndarray, " M"]) -> Ties:
        """What the corrections say of the pieces.

        Args:
            cut: The pieces.
            kept: The row of the uncut paths that each of their rows was.
        """
        found = possible(cut.firsts, cut.lasts, self._told(cut, kept))
        assert found is not None
        return found

    def _told(self, cut: Paths, kept: Int[ndarray, " M"]) -> Iterator[Said]:
        for one in self._corrections:
            if one.kind == "nobody":
                inside = self._inside[one.id][kept]
                gone = mostly_inside(cut.owners, cut.steps, inside, one)
                yield Said(nobody=gone, meant=gone)
            elif one.kind == "here":
                piece = self._piece(one.places[0], cut, kept, before=True)
                yield Said(meant={piece} - {-1}, somebody={piece} - {-1})
            elif one.kind != "checked":
                yield self._of_people(one, cut, kept)

    def _of_people(self, one: Correction, cut: Paths, kept: Int[ndarray, " M"]) -> Said:
        later = {"same": 1, "different": 1, "exchanged": 2}.get(one.kind, 0)
        own = {
            place: self._piece(place, cut, kept, before=number < later or one.kind == "left")
            for number, place in enumerate(one.places)
        }
        meant = {piece for piece in own.values() if piece >= 0}
        if len(meant) < len(set(own.values())):
            return Said(meant=meant)  # somebody is not found
        first = own[one.places[0]]
        return Said(
            [(own[a], own[b]) for a, b in one.pairs],
            [(own[a], own[b]) for a, b in one.apart],
            first=first if one.kind == "came" else -1,
            last=first if one.kind == "left" else -1,
            meant=meant,
        )

    def _piece(
        self, place: Place, cut: Paths, kept: Int[ndarray, " M"], *, before: bool = False
    ) -> int:
        """The piece that is meant: of the path that is there, the one at or next to the place.

        Args:
            place: Of a correction.
            cut: The pieces.
            kept: The row of the uncut paths that each of their rows was.
            before: Whether what lies before the place is nearer than what lies after it.
        """
        row = self._rows[place]
        if row is None or not len(kept):
            return -1
        path, owners = self._owners[row], self._owners[kept]
        own = np.flatnonzero(owners == path)
        if not len(own):
            return -1
        rows = kept[own]
        here = int(np.searchsorted(rows, row, side="right" if before else "left")) - before
        here = min(max(here, 0), len(own) - 1)
        return int(cut.owners[own[here]])


def possible(
    firsts: Int[ndarray, " n"],
    lasts: Int[ndarray, " n"],
    told: Iterable[Said],
    *,
    strict: bool = False,
) -> Ties | None:
    """Of what corrections say of pieces, in their order, all that can be obeyed together.

    The pieces of one person must follow one another in time; of two that cannot both be, the
    earlier counts, and the later correction will be told as unmet.

    Args:
        firsts: The first step of each piece.
        lasts: The last.
        told: By each correction.
        strict: Whether None is returned where not all can be obeyed.
    """
    groups: dict[int, list[int]] = {}
    apart: list[tuple[int, int]] = []
    nobody: set[int] = set()
    came: set[int] = set()
    left: set[int] = set()
    somebody: set[int] = set()

    def joined(pairs: list[tuple[int, int]]) -> dict[int, list[int]] | None:
        """The groups with more pairs, None where somebody would be in two places at once."""
        found = dict(groups)
        for i, j in pairs:
            one, other = found.get(i, [i]), found.get(j, [j])
            if one is other or i == j:
                continue
            both = sorted({*one, *other}, key=lambda piece: int(firsts[piece]))
            if any(lasts[a] >= firsts[b] for a, b in itertools.pairwise(both)):
                return None
            for piece in both:
                found[piece] = both
        return found

    for one in told:
        grown = joined([pair for pair in one.together if pair[0] != pair[1]])
        if grown is None or any(piece in nobody for pair in one.together for piece in pair):
            if strict:
                return None
            continue
        more = [pair for pair in one.apart if pair[0] != pair[1]]
        if any(
            grown.get(i) is not None and grown.get(i) is grown.get(j) for i, j in [*apart, *more]
        ):
            if strict:
                return None
            continue
        groups, apart = grown, [*apart, *more]
        nobody |= {piece for piece in one.nobody if piece not in groups}
        came |= {one.first} - {-1}
        left |= {one.last} - {-1}
        somebody |= one.somebody
    members = {tuple(group) for group in groups.values()}
    together = [pair for group in sorted(members) for pair in itertools.pairwise(group)]
    sure = {piece for group in members for piece in group} | came | left | somebody
    return Ties(
        tuple(together),
        tuple(apart),
        frozenset(sure - nobody),
        frozenset(nobody),
        frozenset(came),
        frozenset(left),
    )

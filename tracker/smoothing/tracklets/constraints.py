"""Constraints on the linking of tracklets from a user's corrections, and their resolution."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from tracker.corrections import Correction, Place
from tracker.corrections.constraints import Constraints
from tracker.corrections.lookup import TrackIndex, mostly_inside
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted
from tracker.smoothing.tracklets.motion import find_exchange

_EVER = int(np.iinfo(np.int64).max)


def split_by_gap(
    constraints: Constraints[int], tracklets: Paths, longest: int
) -> tuple[Constraints[int], Constraints[int]]:
    """Split the constraints into those for links over short gaps and those over long ones.

    Args:
        constraints: Constraints on the tracklets.
        tracklets: The tracklets.
        longest: Longest gap, in steps, over which tracklets are linked by motion alone.
    """
    near = tuple(
        (i, j)
        for i, j in constraints.must_link
        if tracklets.firsts[j] - tracklets.lasts[i] <= longest
    )
    far = tuple(pair for pair in constraints.must_link if pair not in near)
    return replace(constraints, must_link=near), replace(constraints, must_link=far)


def existence_spans(
    constraints: Constraints[int], chains: Many[Many[int]], tracklets: Paths
) -> dict[int, tuple[int, int]]:
    """The first and the last step at which the tracks of some chains may exist.

    A track ends before the tracklet that it must not be linked to begins.

    Args:
        constraints: Constraints on the tracklets.
        chains: The tracklets of each track, in the order of time.
        tracklets: The tracklets.

    Returns:
        First and last step by the index of the chain, for the chains that are limited.
    """
    number = {tracklet: k for k, chain in enumerate(chains) for tracklet in chain}
    found: dict[int, tuple[int, int]] = {}

    def limit(tracklet: int, first: int, last: int) -> None:
        k = number.get(tracklet, -1)
        if k >= 0:
            low, high = found.get(k, (0, _EVER))
            begins, ends = tracklet == chains[k][0], tracklet == chains[k][-1]
            found[k] = max(low, first if begins else 0), min(high, last if ends else high)

    for one, other in constraints.cannot_link:
        i, j = (one, other) if tracklets.firsts[one] <= tracklets.firsts[other] else (other, one)
        if tracklets.lasts[i] < tracklets.firsts[j]:
            limit(i, 0, int(tracklets.firsts[j]) - 1)
            limit(j, int(tracklets.lasts[i]) + 1, _EVER)
    for tracklet in constraints.firsts:
        limit(tracklet, int(tracklets.firsts[tracklet]), _EVER)
    for tracklet in constraints.lasts:
        limit(tracklet, 0, int(tracklets.lasts[tracklet]))
    return found


def constraints_on_chains(
    constraints: Constraints[int], chains: Many[Many[int]], tracklets: Paths
) -> Constraints[int] | None:
    """The same constraints on chains of tracklets, by their indices.

    Args:
        constraints: Constraints on the tracklets, each of which is in a chain.
        chains: The tracklets of each chain, in the order of time.
        tracklets: The tracklets.

    Returns:
        The constraints; None where two chains that must be linked overlap in time.
    """
    number = {tracklet: k for k, chain in enumerate(chains) for tracklet in chain}
    found = replace(constraints, targets=frozenset(), clutter=frozenset()).mapped(number)
    firsts = np.array([tracklets.firsts[chain[0]] for chain in chains], dtype=np.int64)
    lasts = np.array([tracklets.lasts[chain[-1]] for chain in chains], dtype=np.int64)
    return combine_constraints(firsts, lasts, [found], strict=True)


class ConstraintResolver:
    """Finds the tracks that corrections refer to, among paths and among their tracklets."""

    def __init__(self, fitted: Fitted, corrections: Many[Correction], leeway: int) -> None:
        """Find the row of the paths that each place of the corrections refers to.

        Args:
            fitted: The paths before they are split, with N rows.
            corrections: The corrections in the order in which they were made.
            leeway: Number of steps by which a track may miss the step of a place.
        """
        paths = fitted.paths
        self._fitted, self._corrections, self._leeway = fitted, corrections, leeway
        self._jumps = fitted.jumps if any(one.kind == "different" for one in corrections) else None
        self._steps, self._owners = paths.steps, paths.owners
        self._whereabouts = TrackIndex(self._steps, paths.states[:, :3], self._owners)
        self._rows = {
            place: self._whereabouts.nearest(place, leeway=leeway)
            for one in corrections
            if one.kind not in ("here", "nobody", "checked")
            for place in one.places
        }
        self._rows |= {
            one.places[0]: self._whereabouts.row_of(one)
            for one in corrections
            if one.kind == "here"
        }
        self._inside = {
            one.id: self._whereabouts.inside(one) for one in corrections if one.kind == "nobody"
        }

    def breaks(self) -> Bool[ndarray, " N"]:
        """The rows before which a correction splits its path.

        A correction about two steps does not determine the step between them at which to split:
        it is the one at which the parts before and after fit best.
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
        """The rows before which the paths are split for one correction of identity.

        Where two places of one person lie on two paths, both are split where one continues as the
        other; where two places of two people lie on one path, it is split between them.
        """
        found: list[int] = []
        for a, b in one.constraints.must_link:
            earlier, later = self._rows[a], self._rows[b]
            if earlier is None or later is None or self._owners[earlier] == self._owners[later]:
                continue
            before, after = [earlier], [later]
            if one.kind == "exchanged":  # both turn at once
                before, after = (
                    [row for place in some if (row := self._rows[place]) is not None]
                    for some in (one.places[:2], one.places[2:])
                )
            found += find_exchange(
                self._fitted, int(self._owners[earlier]), int(self._owners[later]),
                int(self._steps[before].max()), int(self._steps[after].min()),
            )  # fmt: skip
        for a, b in one.constraints.cannot_link:
            earlier, later = self._rows[a], self._rows[b]
            if earlier is None or later is None or earlier >= later or self._jumps is None:
                continue
            if one.kind == "different" and self._owners[earlier] == self._owners[later]:
                between = slice(earlier + 1, later + 1)
                found.append(earlier + 1 + int(np.argmax(self._jumps[between])))
        return found

    def referenced_tracklets(self, tracklets: Paths, source_rows: Int[ndarray, " M"]) -> set[int]:
        """The tracklets that any correction refers to.

        Args:
            tracklets: The tracklets, with M rows.
            source_rows: Index of each of the M rows in the paths before the splits.
        """
        found: set[int] = set()
        for one in self._corrections:
            found |= set(self._tracklets(one, tracklets, source_rows).values())
            found |= self._resolved(one, tracklets, source_rows).clutter
        return found - {-1}

    def constraints(self, tracklets: Paths, source_rows: Int[ndarray, " M"]) -> Constraints[int]:
        """The constraints of all corrections on the tracklets, as far as they are consistent.

        Args:
            tracklets: The tracklets, with M rows.
            source_rows: Index of each of the M rows in the paths before the splits.
        """
        wanted = [self._resolved(one, tracklets, source_rows) for one in self._corrections]
        found = combine_constraints(tracklets.firsts, tracklets.lasts, wanted)
        assert found is not None
        return found

    def _resolved(
        self, one: Correction, tracklets: Paths, source_rows: Int[ndarray, " M"]
    ) -> Constraints[int]:
        """The constraints of one correction on tracklets, none where a place has no tracklet."""
        if one.kind == "nobody":
            inside = self._inside[one.id][source_rows]
            gone = mostly_inside(tracklets.owners, tracklets.steps, inside, one)
            return Constraints(clutter=frozenset(gone))
        own = self._tracklets(one, tracklets, source_rows)
        return Constraints() if -1 in own.values() else one.constraints.mapped(own)

    def _tracklets(
        self, one: Correction, tracklets: Paths, source_rows: Int[ndarray, " M"]
    ) -> dict[Place, int]:
        """The tracklet that each place of a correction refers to, -1 for none."""
        if one.kind in ("nobody", "checked"):  # of areas and steps
            return {}
        if one.kind == "here":  # the second place is where a run had the person
            place = one.places[0]
            return {place: self._tracklet(place, tracklets, source_rows, before=True)}
        later = {"same": 1, "different": 1, "exchanged": 2}.get(one.kind, 0)
        return {
            place: self._tracklet(
                place, tracklets, source_rows, before=number < later or one.kind == "left"
            )
            for number, place in enumerate(one.places)
        }

    def _tracklet(
        self,
        place: Place,
        tracklets: Paths,
        source_rows: Int[ndarray, " M"],
        *,
        before: bool = False,
    ) -> int:
        """The tracklet that a place refers to: of the path there, the one at or next to the place.

        Args:
            place: A place of a correction.
            tracklets: The tracklets, with M rows.
            source_rows: Index of each of the M rows in the paths before the splits.
            before: Whether the tracklet before the place is preferred to the one after it.

        Returns:
            The index of the tracklet, -1 for none.
        """
        row = self._rows[place]
        if row is None or not len(source_rows):
            return -1
        path, owners = self._owners[row], self._owners[source_rows]
        own = np.flatnonzero(owners == path)
        if not len(own):
            return -1
        rows = source_rows[own]
        here = int(np.searchsorted(rows, row, side="right" if before else "left")) - before
        here = min(max(here, 0), len(own) - 1)
        return int(tracklets.owners[own[here]])


def combine_constraints(
    firsts: Int[ndarray, " n"],
    lasts: Int[ndarray, " n"],
    wanted: Iterable[Constraints[int]],
    *,
    strict: bool = False,
) -> Constraints[int] | None:
    """Combine the constraints of corrections, in their order, as far as they are consistent.

    The tracklets of one person must follow one another in time. Of two constraints that
    contradict each other the earlier holds, and the later correction is reported as unmet.

    Args:
        firsts: The first step of each of n tracklets.
        lasts: The last step of each tracklet.
        wanted: The constraints of each correction.
        strict: Whether None is returned where not all of them are consistent.
    """
    groups: dict[int, list[int]] = {}
    cannot_link: list[tuple[int, int]] = []
    clutter: set[int] = set()
    came: set[int] = set()
    left: set[int] = set()
    targets: set[int] = set()

    def joined(pairs: list[tuple[int, int]]) -> dict[int, list[int]] | None:
        """The groups with more pairs, None where a person would be in two places at once."""
        found = dict(groups)
        for i, j in pairs:
            one, other = found.get(i, [i]), found.get(j, [j])
            if one is other:
                continue
            both = sorted({*one, *other}, key=lambda tracklet: int(firsts[tracklet]))
            if any(lasts[a] >= firsts[b] for a, b in itertools.pairwise(both)):
                return None
            for tracklet in both:
                found[tracklet] = both
        return found

    for one in wanted:
        grown = joined([pair for pair in one.must_link if pair[0] != pair[1]])
        if grown is None or any(tracklet in clutter for pair in one.must_link for tracklet in pair):
            if strict:
                return None
            continue
        more = [pair for pair in one.cannot_link if pair[0] != pair[1]]
        if any(
            grown.get(i) is not None and grown.get(i) is grown.get(j)
            for i, j in [*cannot_link, *more]
        ):
            if strict:
                return None
            continue
        groups, cannot_link = grown, [*cannot_link, *more]
        clutter |= {tracklet for tracklet in one.clutter if tracklet not in groups}
        came |= one.firsts
        left |= one.lasts
        targets |= one.targets
    members = {tuple(group) for group in groups.values()}
    must_link = [pair for group in sorted(members) for pair in itertools.pairwise(group)]
    sure = {tracklet for group in members for tracklet in group} | came | left | targets
    return Constraints(
        tuple(must_link),
        tuple(cannot_link),
        frozenset(sure - clutter),
        frozenset(clutter),
        frozenset(came),
        frozenset(left),
    )

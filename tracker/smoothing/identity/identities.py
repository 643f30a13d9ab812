"""Who is who over the whole recording: tracks cut where it was a draw, and joined again.

The tracks of the filter are cut where its association marginals were near a draw, where past
and future contradict each other, and where nobody saw them for long. What is left are pieces
that are surely one person's; all of them together are joined at the least cost.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.kinds import OF_PEOPLE, digest
from tracker.corrections.kinds import leeway as corrections_leeway
from tracker.corrections.outcomes import outcomes
from tracker.geometry.assignment import names_by_majority
from tracker.parameters import SmoothingParams
from tracker.smoothing.identity import cutting, joining, odds, pieces
from tracker.smoothing.identity import decisions as decided
from tracker.smoothing.identity.constraints import Seeker, Ties
from tracker.smoothing.identity.cutting import Tracked
from tracker.smoothing.identity.ends import Ends
from tracker.smoothing.identity.people import Seen, told_of_people
from tracker.smoothing.identity.people import of_chains as people_of_chains
from tracker.smoothing.identity.program import Cut
from tracker.smoothing.identity.staying import Staying
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.protocol import Earlier, Nothing
from tracker.smoothing.result import Decision, Joined
from tracker.smoothing.smoother import Shared

_SURE = 1e6
"""Log odds of chains that were found somebody's already."""

_CAREFUL = 3
"""How often only those corrections are made to hold of which no earlier one speaks of the same
people; then all that do not hold: dozens that hang together would take as many turns."""

_TURNS = 2
"""How often pieces are joined anew by what their chains say of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """Pieces joined into the tracks of people."""

    paths: Paths
    links: Links
    origins: Int[ndarray, " n"]
    """The path before the cuts of which each has most."""
    had: Bool[ndarray, " N"]
    """The rows of pieces: the others are of the gaps between them."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had nobody."""
    decisions: list[Decision]
    joined: Joined
    limits: dict[int, tuple[int, int]]
    """Of some labels the first and the last step at which corrections let them be."""
    people: Int[ndarray, " R"]
    """The label of each row before the cuts, -1 where nobody has it."""


def settle(
    tracked: Tracked,
    parameters: SmoothingParams,
    seen: Seen,
    corrections: Many[Correction] = (),
    earlier: Earlier | None = None,
) -> tuple[Settled, str]:
    """Cut and join.

    Of what a person said of who is who only what does not hold by itself is made to hold, one
    after another: who says that it is as it is changes nothing. What nobody speaks of stays, as
    far as it can, as it is settled without them.

    Args:
        tracked: By the filter, or as settled before.
        parameters: When to cut, and what holds together.
        seen: What the boxes look like.
        corrections: What a person said of who is who.
        earlier: What was found for these tracks while other corrections were obeyed: most of what
            is obeyed on the way to all of them is what was on the way to all but the newest.

    Returns:
        The people, and a hash of what had to be made to hold for them.
    """
    earlier = earlier or Nothing()
    leeway = corrections_leeway(tracked.smoother.model.step_time)
    waiting = [one for one in corrections if one.pairs or one.apart]
    plain: cutting.Cuts | None = None
    staying = Staying()
    turn = 0
    while True:
        obeyed = [one for one in corrections if one not in waiting]
        key = f"settled-{digest(obeyed, OF_PEOPLE)}"
        found: Settled | None = earlier.get(key)
        if found is None:
            plain = plain or earlier.get("cuts") or cutting.cuts(tracked, parameters)
            earlier.put("cuts", plain)
            found = _settled(tracked, parameters, seen, obeyed, leeway, plain, staying)
            earlier.put(key, found)
        if staying.people is None:
            staying = Staying(found.people)
        unmet = _unmet(found.paths, waiting, leeway, careful=turn < _CAREFUL)
        if not unmet:
            return found, key
        waiting, turn = [one for one in waiting if one not in unmet], turn + 1


def _unmet(
    paths: Paths, waiting: Many[Correction], leeway: int, *, careful: bool
) -> list[Correction]:
    """Those that do not hold; where one is careful, but for what may hold once an earlier one does
    that speaks of the same people: whom somebody meets later depends on who he was before."""
    if not waiting:
        return []
    told = outcomes(
        paths.steps, paths.labels[paths.owners], paths.states[:, :3], waiting, leeway=leeway
    )
    found: list[Correction] = []
    touched: set[int] = set()
    for one, outcome in zip(waiting, told, strict=True):
        if outcome.met:
            continue
        if careful and not outcome.tracks:  # of whom nobody was found that may be anybody
            return found or [one]
        if not careful or touched.isdisjoint(outcome.tracks):
            found.append(one)
        touched |= set(outcome.tracks)
    return found


def _settled(
    tracked: Tracked,
    parameters: SmoothingParams,
    seen: Seen,
    corrections: Many[Correction],
    leeway: int,
    plain: cutting.Cuts,
    staying: Staying,
) -> Settled:
    """Cut and join with all of some corrections."""
    smoother, fitted, shared = tracked.smoother, tracked.fitted, tracked.shared
    seeker = Seeker(fitted, corrections, leeway)
    cut, kept = cutting.cut(tracked, plain, seeker)
    ties = seeker.ties(cut, kept)
    links = pieces.moved(shared.links, kept, len(fitted.paths.states))
    refitted = smoother.fit(cut, links)
    own = Shared(links, shared.chances[:, kept], shared.missed[:, kept], shared.hidden_by[:, kept])
    worths, births, deaths = odds.of_pieces(smoother, refitted, own, parameters)
    alone = Ends.alone(refitted, smoother.prior)
    goes_on = odds.GoesOn(smoother, refitted.paths, links, parameters, seen.looks)
    pairs = goes_on.by(alone)
    people = told_of_people(refitted.paths, links, smoother, seen, parameters.appearance)
    longest = max(round(parameters.longest / smoother.model.step_time), 1)
    now, later = ties.parted(cut, longest)
    cuts: list[Cut] = []

    def chained(pairs: pieces.Pairs, ties: Ties) -> list[list[int]]:
        """The chains of pieces that are worth most together, as far as the ties let them."""
        gains = staying.gains(pairs, cut, kept)
        following, used = joining.join(
            worths, births, deaths, pairs.earlier, pairs.later, gains, ties, people, cuts
        )
        return joining.chains(following, used)

    first = chained(pairs, now)
    for _ in range(_TURNS):  # who is joined to whom tells of the ends of the pieces in between
        several = [chain for chain in first if len(chain) > 1]
        if not several:
            break
        whole, rows = pieces.chained(refitted.paths, several, list(range(len(several))))
        told = alone.in_chains(
            cut, smoother.fit(whole, pieces.moved_to(links, rows)), rows, smoother.model.motion
        )
        pairs = goes_on.by(told)
        again = chained(pairs, now)
        if again == first:
            break
        first = again
    of_chains = later.of_chains(first, cut)
    if of_chains is None:  # who is tied to somebody far away may not be joined to another meanwhile
        first = chained(pairs, ties)
        of_chains = replace(ties, together=()).of_chains(first, cut) or Ties()
    # what goes on by its motion tells more of its looks than each piece alone
    back = odds.comes_back(smoother, refitted.paths, links, first, parameters, seen.looks)
    following, _ = joining.join(
        np.full(len(first), _SURE), births[[c[0] for c in first]], deaths[[c[-1] for c in first]],
        back.earlier, back.later, back.gains, of_chains,
        people_of_chains(people, first),
    )  # fmt: skip
    chains = [
        [piece for number in numbers for piece in first[number]]
        for numbers in joining.chains(following, np.ones(len(first), dtype=bool))
    ]
    pairs = pairs.with_more(back.of_ends(first))
    labels = _labels(cut, chains)
    decisions = decided.cuts(cut, fitted.paths, kept, plain.reasons, chains, labels)
    decisions += decided.joins(cut, pairs, chains, labels, odds.anew(smoother), set(ties.together))
    paths, rows = pieces.chained(refitted.paths, chains, labels)
    lengths = np.diff(cut.starts)
    origins = [
        _most(fitted.paths.owners[kept[cut.starts[chain]]], lengths[chain]) for chain in chains
    ]
    links = pieces.moved_to(links, rows)
    of_piece = np.zeros(len(paths.states), dtype=bool)
    of_piece[rows[rows >= 0]] = True
    names_of = np.full(len(paths.states), -1, dtype=np.int64)
    names_of[rows[rows >= 0]] = tracked.names[kept[rows >= 0]]
    of_pieces = np.full(len(cut.labels), -1, dtype=np.int64)
    for chain, label in zip(chains, labels, strict=True):
        of_pieces[chain] = label
    places = refitted.paths.states[:, :3]
    joined = Joined(
        of_pieces, cut.firsts, cut.lasts, places[cut.starts[:-1]], places[cut.starts[1:] - 1],
        worths, births, deaths, pairs.earlier, pairs.later, pairs.gains,
    )  # fmt: skip
    limits = {labels[k]: span for k, span in ties.limits(chains, cut).items()}
    origins_of = np.array(origins, dtype=np.int64)
    whose = np.full(len(fitted.paths.states), -1, dtype=np.int64)
    whose[kept] = of_pieces[cut.owners]
    return Settled(paths, links, origins_of, of_piece, names_of, decisions, joined, limits, whose)


def _most(names: ndarray, weights: ndarray) -> int:
    """The name with most weight, of equal ones the smallest."""
    values, which = np.unique(names, return_inverse=True)
    return int(values[np.argmax(np.bincount(which, weights))])


def _labels(cut: Paths, chains: list[list[int]]) -> list[int]:
    """A label for each chain: that of most of its rows, where no other chain has more of it."""
    lengths = np.diff(cut.starts)
    counts = []
    for chain in chains:
        names, which = np.unique(cut.labels[chain], return_inverse=True)
        rows = np.bincount(which, lengths[chain]).astype(np.int64)
        counts.append(dict(zip(names.tolist(), rows.tolist(), strict=True)))
    return names_by_majority(counts, int(cut.labels.max(initial=0)))

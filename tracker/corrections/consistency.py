"""Contradictions between corrections, which are refused when the later one is made."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np

from tracker.corrections.kinds import REACH, Correction, CorrectionError, Place

NEAR = 0.3
"""Distance on the ground within which two places of one step are of one person, metres. At one step
at most 0.1 % of the pairs of people in four recordings are nearer to each other, and at least 97 %
of the places of tracks are nearer to the person."""

APART = 2.0 * REACH
"""Distance on the ground from which two places of one step are of two people, metres: each refers
to a track within :data:`~tracker.corrections.kinds.REACH`."""


def refuse_contradiction(before: Many[Correction], new: Correction) -> None:
    """Refuse a correction that cannot be true together with those before.

    Two places of one step within :data:`NEAR` are of one person. Places that *same* and
    *exchanged* attribute to one person must not be attributed to two by *different*, and must not
    be apart at one step; and no place of a person may be in the area that *nobody* states to be
    empty. A person who left may return.

    Args:
        before: The corrections so far.
        new: The correction to add; one of the same id among those before is left out.

    Raises:
        CorrectionError: If there is a contradiction; the message names both corrections.
    """
    known = [one for one in before if one.id != new.id]
    try:
        _check_all([*known, new])
    except _Contradiction as found:
        other = next((one for one in found.others if one is not new), None)
        against = f'"{other.words}"' if other is not None else "itself"
        raise CorrectionError(
            f'"{new.words}" contradicts {against}: {found.why}; take that back first'
        ) from None


def refuse_two_names(first: Many[Correction], second: Many[Correction]) -> None:
    """Refuse two logs that give one person two names; within a log the later name holds.

    Places are of one person within :data:`NEAR` at one step, and where *same* and *exchanged* of
    either log attribute them so. Other identities are known only after a run.

    Raises:
        CorrectionError: If a person has two names; the message names both corrections.
    """
    people = _People.from_corrections((*first, *second))
    numbers = [[(people.of(one.places[0], one), one) for one in log if one.kind == "name"]
               for log in (first, second)]  # fmt: skip
    ones, others = ({people.root(number): one for number, one in log} for log in numbers)
    for person, one in ones.items():
        other = others.get(person)
        if other is not None and other.name != one.name:
            raise CorrectionError(
                f'"{one.words}" in one log and "{other.words}" in the other name one person; '
                "take one of them out first"
            )


def find_repeated(
    before: Many[Correction], new: Correction
) -> tuple[Correction | None, Correction]:
    """Find the *is here* correction that a new one of the same track and step replaces.

    Args:
        before: The corrections so far.
        new: The new correction.

    Returns:
        The correction that is replaced, None for none; and the new one, which then refers to
        the track by its place before either of the two.
    """
    if new.kind != "here" or len(new.places) < 2:
        return None, new
    found = new.places[1]
    for old in reversed(before):
        if old.kind == "here" and old.places[0].step == found.step:
            if _distance(old.places[0], found) <= max(NEAR, old.accuracy or 0.0):
                places = (new.places[0], *old.places[1:])
                return old, new.model_copy(update={"places": places})
    return None, new


class _Contradiction(Exception):
    """Corrections contradict each other."""

    def __init__(self, why: str, *others: Correction) -> None:
        """Describe a contradiction.

        Args:
            why: The contradiction, in words.
            others: The corrections that contradict each other.
        """
        super().__init__(why)
        self.why, self.others = why, others


class _People:
    """Places grouped by person, in a union-find structure."""

    def __init__(self) -> None:
        """Begin without places."""
        self.places: list[tuple[Place, Correction]] = []
        self._parents: list[int] = []

    @classmethod
    def from_corrections(cls, corrections: Many[Correction]) -> _People:
        """Group the places of corrections by person: the two places of each pair are of one."""
        people = cls()
        for one in corrections:
            for earlier, later in one.constraints.must_link:
                people.unite(people.of(earlier, one), people.of(later, one))
        return people

    def of(self, place: Place, correction: Correction) -> int:
        """Return the index of a place, or of one within :data:`NEAR` of it at the same step.

        If there is neither, the place is added.
        """
        for number, (other, _) in enumerate(self.places):
            if other.step == place.step and _distance(other, place) <= NEAR:
                return number
        self.places.append((place, correction))
        self._parents.append(len(self._parents))
        return len(self.places) - 1

    def root(self, number: int) -> int:
        """The index that represents the group of a place."""
        while self._parents[number] != number:
            number = self._parents[number]
        return number

    def unite(self, one: int, other: int) -> None:
        """Unite the groups of two places."""
        self._parents[self.root(one)] = self.root(other)


def _distance(one: Place, other: Place) -> float:
    """The distance of two places on the ground, metres."""
    return float(np.hypot(one.x - other.x, one.y - other.y))


def _check_all(corrections: list[Correction]) -> None:
    """Raise :class:`_Contradiction` if corrections cannot be true together."""
    people = _People.from_corrections(corrections)
    for one in corrections:
        for earlier, later in one.constraints.cannot_link:
            a, b = people.of(earlier, one), people.of(later, one)
            if people.root(a) == people.root(b):
                uniting = next(
                    (
                        other
                        for other in reversed(corrections)
                        if other is not one
                        and other.constraints.must_link
                        and any(_has_place_at(other, p) for p in (earlier, later))
                    ),
                    one,
                )
                raise _Contradiction(
                    "the same person and not the same person", uniting, corrections[-1], one
                )
    groups: dict[int, list[tuple[Place, Correction]]] = {}
    for number, place in enumerate(people.places):
        groups.setdefault(people.root(number), []).append(place)
    for group in groups.values():
        _check_places_of_person(group)
    for one in corrections:
        if one.kind == "nobody":
            _check_empty_place(one, corrections)


def _has_place_at(one: Correction, place: Place) -> bool:
    """Whether a correction has a place within :data:`NEAR` of another one at its step."""
    return any(p.step == place.step and _distance(p, place) <= NEAR for p in one.places)


def _check_places_of_person(group: list[tuple[Place, Correction]]) -> None:
    """Raise :class:`_Contradiction` if places of one person are far apart at one step."""
    by_step: dict[int, tuple[Place, Correction]] = {}
    for place, one in group:
        other = by_step.setdefault(place.step, (place, one))
        if _distance(other[0], place) >= APART:
            raise _Contradiction(
                f"one person would be in two places, {_distance(other[0], place):.1f} m apart, at "
                f"step {place.step}",
                other[1],
                one,
            )


def _check_empty_place(one: Correction, corrections: list[Correction]) -> None:
    """Raise :class:`_Contradiction` if a person is stated to be in the area of a *nobody*."""
    for other in corrections:
        if other.kind not in ("here", "name", "came", "left"):
            continue
        place = other.places[0]
        where = along(one.places, place.step)
        if where is None:
            continue
        if np.hypot(where[0] - place.x, where[1] - place.y) <= min(one.accuracy or 0.0, NEAR):
            raise _Contradiction(f"a person is at {place.words}, and nobody is", other, one)


def along(places: Many[Place], step: int) -> tuple[float, float] | None:
    """Interpolate places linearly at a step: (x, y) in world metres, None before and after them."""
    if not places[0].step <= step <= places[-1].step:
        return None
    steps = [place.step for place in places]
    return (
        float(np.interp(step, steps, [place.x for place in places])),
        float(np.interp(step, steps, [place.y for place in places])),
    )

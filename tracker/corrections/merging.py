"""Comparison and merging of two logs of one recording."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

from tracker.corrections.consistency import refuse_contradiction, refuse_two_names
from tracker.corrections.kinds import Correction, CorrectionError, content_of


@dataclass(frozen=True, slots=True)
class Difference:
    """The difference of two logs."""

    only_first: tuple[Correction, ...]
    """Corrections of the first log alone, by id."""
    only_second: tuple[Correction, ...]
    """Corrections of the second log alone, by id."""
    changed: tuple[tuple[Correction, Correction], ...]
    """Corrections with the same id and different content."""

    @property
    def empty(self) -> bool:
        """Whether both logs have the same corrections."""
        return not (self.only_first or self.only_second or self.changed)


def difference(first: Many[Correction], second: Many[Correction]) -> Difference:
    """Compare two logs; each list is in the order of its log."""
    ones, others = {one.id: one for one in first}, {one.id: one for one in second}
    return Difference(
        tuple(one for one in first if one.id not in others),
        tuple(one for one in second if one.id not in ones),
        tuple((one, others[one.id]) for one in first if others.get(one.id, one) != one),
    )


def merge(first: Many[Correction], second: Many[Correction]) -> tuple[Correction, ...]:
    """Merge two logs in the order of time; of corrections with equal content the first remains.

    Raises:
        CorrectionError: If two corrections have the same id and different content, contradict
            each other, or give one person two names.
    """
    differing = difference(first, second)
    if differing.changed:
        one, other = differing.changed[0]
        raise CorrectionError(
            f'correction {one.id}: expected the same in both logs, found "{one.words}" and '
            f'"{other.words}"; give one of them another id'
        )
    refuse_two_names(first, second)
    again = {content_of(one) for one in differing.only_first}
    again &= {content_of(one) for one in differing.only_second}
    everything = sorted(
        (*first, *differing.only_second), key=lambda one: (one.time.timestamp(), one.id)
    )
    merged: list[Correction] = []
    there: set[str] = set()
    for one in everything:
        content = content_of(one)
        if content in again and content in there:
            continue
        there.add(content)
        refuse_contradiction(merged, one)
        merged.append(one)
    return tuple(merged)

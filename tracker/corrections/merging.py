"""Two logs of one recording: what differs, and both as one."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

from tracker.corrections.contradictions import refuse_contradiction, refuse_two_names
from tracker.corrections.kinds import Correction, CorrectionError, content_of


@dataclass(frozen=True, slots=True)
class Difference:
    """What one log says and the other does not."""

    only_first: tuple[Correction, ...]
    only_second: tuple[Correction, ...]
    changed: tuple[tuple[Correction, Correction], ...]
    """Known by their id in both, with other content."""

    @property
    def empty(self) -> bool:
        """Whether both say the same."""
        return not (self.only_first or self.only_second or self.changed)


def difference(first: Many[Correction], second: Many[Correction]) -> Difference:
    """What differs, each in the order of its own log."""
    ones, others = {one.id: one for one in first}, {one.id: one for one in second}
    return Difference(
        tuple(one for one in first if one.id not in others),
        tuple(one for one in second if one.id not in ones),
        tuple((one, others[one.id]) for one in first if others.get(one.id, one) != one),
    )


def merge(first: Many[Correction], second: Many[Correction]) -> tuple[Correction, ...]:
    """All of both, in the order of their times; what both say counts once, as it was said first.

    Raises:
        CorrectionError: If one says another thing under the same id, contradicts one, or gives
            another name to somebody.
    """
    told = difference(first, second)
    if told.changed:
        one, other = told.changed[0]
        raise CorrectionError(
            f'correction {one.id}: expected the same in both logs, found "{one.words}" and '
            f'"{other.words}"; give one of them another id'
        )
    refuse_two_names(first, second)
    again = {content_of(one) for one in told.only_first}
    again &= {content_of(one) for one in told.only_second}
    everything = sorted((*first, *told.only_second), key=lambda one: (one.time.timestamp(), one.id))
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

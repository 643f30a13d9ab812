"""Moments under review that are asked for by their ids."""

from __future__ import annotations

from app.errors import ApiError
from tracker.review.queue import ReviewItem


def known_item(item: ReviewItem | None, identity: str) -> ReviewItem:
    """A moment under review.

    Raises:
        ApiError: If there is none of that id.
    """
    if item is None:
        raise ApiError(
            404, "no_doubt", f"There is no doubtful place {identity} any more.",
            hint="The list of places to check has those of the shown run.",
        )  # fmt: skip
    return item


def alternative_of(item: ReviewItem, number: int) -> int:
    """The number of an alternative.

    Raises:
        ApiError: If there is none of that number.
    """
    if not 0 <= number < len(item.alternatives):
        raise ApiError(
            404, "no_alternative", f"Expected an alternative below {len(item.alternatives)}, "
            f"got {number}.", hint="0 is as it is.",
        )  # fmt: skip
    return number

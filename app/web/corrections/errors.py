"""What cannot be corrected or answered, in the one shape of errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from app.errors import ApiError, as_sentence
from tracker.corrections import CorrectionError
from tracker.review.queue import ReviewItem


@contextmanager
def refusing(status: int = 422) -> Iterator[None]:
    """Within it a correction that does not fit is the client's to mend."""
    try:
        yield
    except CorrectionError as error:
        words = as_sentence(str(error))
        raise ApiError(status, "cannot_correct", words, hint="Nothing was changed.") from None


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

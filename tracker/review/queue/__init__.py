"""The review queue: where a run may be wrong, ordered by the expected number of wrong steps.

Each source of items has a module; :func:`tracker.review.queue.ranking.queue` orders all items.
"""

from tracker.review.queue.item import Alternative, ReviewItem
from tracker.review.queue.ranking import Queue, queue

__all__ = ["Alternative", "Queue", "ReviewItem", "queue"]

"""Where a run may be wrong, the most at stake first: what a person should look at.

One file a source of doubt; :func:`tracker.review.queue.ranking.queue` has them all in one order.
"""

from tracker.review.queue.item import Alternative, ReviewItem
from tracker.review.queue.ranking import Queue, queue

__all__ = ["Alternative", "Queue", "ReviewItem", "queue"]

"""The review queue: where a run may be wrong, ordered by the expected number of wrong steps.

Each source of items has a module; :func:`tracker.review.queue.ranking.queue` orders all items.

What the constants of these modules change was measured one at a time: on queues of random crowds of
twelve people, of random rooms that people leave and whose detectors miss a third, and of three
recordings, with and without smoothing. They have 292 items, and of the first fifteen of each queue
together 79 are mistakes of the run; "found" in the modules is this number.
"""

from tracker.review.queue.item import Alternative, ReviewItem
from tracker.review.queue.ranking import Queue, queue

__all__ = ["Alternative", "Queue", "ReviewItem", "queue"]

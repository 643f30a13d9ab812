"""Where a run may be wrong, the most at stake first: what a person should look at.

One file a source of doubt; :func:`tracker.doubts.queue.queue` has them all in one order.
"""

from tracker.doubts.doubt import Alternative, Doubt
from tracker.doubts.queue import Queue, queue

__all__ = ["Alternative", "Doubt", "Queue", "queue"]

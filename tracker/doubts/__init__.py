"""Where a run may be wrong, the most at stake first: what a person should look at.

One file a source of doubt; :func:`tracker.doubts.ranking.queue` has them all in one order.
"""

from tracker.doubts.doubt import Alternative, Doubt
from tracker.doubts.ranking import Queue, queue

__all__ = ["Alternative", "Doubt", "Queue", "queue"]

"""The doubtful places of the shown run, made once for each."""

from __future__ import annotations

import threading

from app.state.snapshot import Snapshot
from tracker.review.queue import Queue, ReviewItem, queue

_NOTHING = Queue((), 0, "there is no run yet")

_MOST = 1000
"""Places that are known of queues before."""


class Doubting:
    """Keeps the queue of the run that was asked for last, and what queues before it had."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: tuple[tuple[str, int, bool, tuple[str, ...]], Queue] | None = None
        self._of = ""
        self._told: dict[str, ReviewItem] = {}

    def of(self, snapshot: Snapshot) -> Queue:
        """The doubtful places of what is shown, as far as it is computed."""
        run = snapshot.run
        if run is None:
            return _NOTHING
        complete = run.complete and snapshot.run_state.state != "computing"
        # what is answered is known at once, whether a run that obeys it is there or not
        said = snapshot.corrections
        key = (run.key, run.done // 50, complete, tuple(one.id for one in said))
        with self._lock:
            if self._made is None or self._made[0] != key:
                self._made = key, queue(run, corrections=said)
                self._remember(snapshot.sequence_key, self._made[1])
            return self._made[1]

    def _remember(self, sequence: str, made: Queue) -> None:
        if sequence != self._of:
            self._of, self._told = sequence, {}
        for one in made.items:
            self._told.pop(one.id, None)
            self._told[one.id] = one
        for old in list(self._told)[:-_MOST]:
            del self._told[old]

    def find(self, snapshot: Snapshot, identity: str) -> ReviewItem | None:
        """One of them; None where it is not there any more."""
        return next((one for one in self.of(snapshot).items if one.id == identity), None)

    def told(self, snapshot: Snapshot, identity: str) -> ReviewItem | None:
        """One of them, or of a run before: what somebody says of steps and places who still has
        it on the page is as true of the run that came meanwhile."""
        found = self.find(snapshot, identity)
        with self._lock:
            known = self._told if self._of == snapshot.sequence_key else {}
            return found or known.get(identity)

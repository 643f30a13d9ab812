"""The doubtful places of the shown run, made once for each."""

from __future__ import annotations

import threading

from app.state.snapshot import Snapshot
from tracker.doubts import Doubt, Queue, queue

_NOTHING = Queue((), 0, "there is no run yet")


class Doubting:
    """Keeps the queue of the run that was asked for last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: tuple[tuple[str, int, bool], Queue] | None = None

    def of(self, snapshot: Snapshot) -> Queue:
        """The doubtful places of what is shown, as far as it is computed."""
        run = snapshot.run
        if run is None:
            return _NOTHING
        complete = run.complete and snapshot.run_state.state != "computing"
        key = (run.key, run.done // 50, complete)
        with self._lock:
            if self._made is None or self._made[0] != key:
                self._made = key, queue(run)
            return self._made[1]

    def find(self, snapshot: Snapshot, identity: str) -> Doubt | None:
        """One of them; None where it is not there any more."""
        return next((one for one in self.of(snapshot).doubts if one.id == identity), None)

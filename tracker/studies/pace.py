"""How fast a study goes: what is left, and how busy the workers are."""

from __future__ import annotations

import time


class Pace:
    """Of one start of a study."""

    def __init__(self) -> None:
        self.runs = 0
        """That ended."""
        self.worked = 0.0
        """Seconds that workers took for them."""
        self._warm: float | None = None
        self._since_warm = 0.0
        self._first: tuple[float, int] | None = None

    def came(self, seconds: float) -> None:
        """A run ended that took a worker so long."""
        self.runs += 1
        self.worked += seconds
        if self._warm is None:
            self._warm = time.monotonic()
        else:
            self._since_warm += seconds

    def busy(self, slots: int) -> float | None:
        """Share of the workers' time since the first run ended in which they worked; None before
        each had two."""
        if self._warm is None or self.runs < 2 * slots:
            return None
        elapsed = time.monotonic() - self._warm
        return min(1.0, self._since_warm / (elapsed * slots)) if elapsed > 0.0 else None

    def seconds_left(self, done: int, trials: int) -> float | None:
        """From the mean time of a trial so far; None before two ended."""
        if self._first is None:
            self._first = time.monotonic(), done
        begin, before = self._first
        if done - before < 2:
            return None
        return (trials - done) * (time.monotonic() - begin) / (done - before)

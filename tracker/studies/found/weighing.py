"""When it is found out what matters: by a worker, whenever there is much more to tell from."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tracker.studies.defined.definition import Varied
from tracker.studies.found import importance
from tracker.studies.kept.records import Trial
from tracker.studies.work.cluster import Crew

GROWTH = 2.0
"""It is found out anew when there are so many times more trials."""

SHARE = 0.005
"""Of the workers' time at most so much is spent on it before the end."""

NEARLY = 0.9
"""At the end it is left as it is where it was told by this share of the trials."""

LAST_SECONDS = 60.0
"""At most so long the end of a study waits for it."""


class Weighing:
    """Of one start of a study."""

    def __init__(self, varied: Sequence[Varied], defaults: Mapping[str, Any]) -> None:
        """Nothing is asked for yet.

        Args:
            varied: What is varied.
            defaults: What it is by default.
        """
        self._varied, self._defaults = tuple(varied), dict(defaults)
        self._asked: Callable[[], Any | None] | None = None
        self._weighed = 0
        self._spent = self._took = 0.0

    def news(
        self, complete: Sequence[Trial], crew: Crew, *, worked: float, last: bool = False
    ) -> dict[str, Any] | None:
        """What was found out since, if anything was.

        Args:
            complete: Trials that ended with all their runs.
            crew: Has it computed.
            worked: Seconds that the workers took for runs so far.
            last: Whether no more trials come: then it is waited for.
        """
        found = self._found()
        until = time.monotonic() + LAST_SECONDS
        while True:  # at the end what was asked for earlier may not be there yet
            self._ask(complete, crew, worked, last)
            if not last or self._asked is None or time.monotonic() >= until:
                return found
            time.sleep(0.02)
            found = self._found() or found

    def _ask(self, complete: Sequence[Trial], crew: Crew, worked: float, last: bool) -> None:
        needed = self._weighed / NEARLY if last else self._weighed * GROWTH
        spared = last or self._spent + GROWTH * self._took <= SHARE * worked
        if self._asked is None and spared and len(complete) >= max(importance.FEWEST, needed):
            self._weighed = len(complete)
            rows = [(one.values, one.objectives) for one in complete if one.objectives]
            self._asked = crew.call(importance.importance, self._varied, rows, self._defaults)

    def _found(self) -> dict[str, Any] | None:
        found = None if self._asked is None else self._asked()
        if found is not None:
            self._asked = None
            self._took = found.pop("seconds")
            self._spent += self._took
        return found

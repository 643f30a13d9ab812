"""The interface of every smoothing method: from all steps of the filter to smoothed tracks."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from typing import Any, Protocol

from tracker.corrections import Correction
from tracker.fusion.protocol import FusionResult
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.result import Smoothed


class ResultStore(Protocol):
    """Intermediate results of runs that differ from this one only in corrections of identity.

    A stored result is never changed, and equals bit for bit that of computing it again.
    """

    def get(self, what: str) -> Any:
        """Return the result stored under a name, None if there is none."""
        ...

    def put(self, what: str, found: object) -> None:
        """Store a result under a name for later runs."""
        ...


class EmptyStore:
    """A store that is always empty."""

    def get(self, what: str) -> Any:
        """Return None, since no result is stored."""
        return None

    def put(self, what: str, found: object) -> None:
        """Discard the result."""


class SmoothingMethod(Protocol):
    """A smoothing method, prepared for one sequence."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: ResultStore | None = None,
    ) -> Smoothed | None:
        """Estimate the tracks of some steps from step 0 on, each from the boxes of all steps.

        Args:
            views: The results of stage 1 for each step.
            fused: The result of stage 2 for each step.
            check: A function that is called repeatedly, and raises an exception to stop the work.
            corrections: The user's corrections; passed only if there are any.
            earlier: The store of intermediate results of runs with the same boxes, tracks of the
                filter and constraints of places; passed only to methods that have this argument.

        Returns:
            The tracks; None where those of the filter do not change.
        """
        ...


class NoSmoothing:
    """No smoothing: the filter's tracks, as a live system would have them."""

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """The method needs no preparation."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: ResultStore | None = None,
    ) -> None:
        """Return None: the filter's tracks do not change."""

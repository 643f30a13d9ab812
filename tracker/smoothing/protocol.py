"""The interface of every smoothing method: all steps of the filter in, smoothed tracks out."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from typing import Any, Protocol

from tracker.corrections import Correction
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.result import Smoothed


class Earlier(Protocol):
    """What runs that differ from this one only in who is said to be whom found on their way.

    What is kept is never changed, and is what would be found again: bit for bit.
    """

    def get(self, what: str) -> Any:
        """Something that was kept, None where it is not there."""
        ...

    def put(self, what: str, found: object) -> None:
        """Keep something for later runs."""
        ...


class Nothing:
    """Nothing is known of earlier runs, and nothing is kept."""

    def get(self, what: str) -> Any:
        """None."""
        return None

    def put(self, what: str, found: object) -> None:
        """Let it go."""


class SmoothingMethod(Protocol):
    """One method, prepared for one sequence."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: Earlier | None = None,
    ) -> Smoothed | None:
        """The tracks of some steps from step 0 on, each by the boxes of all of them.

        Args:
            views: Stage 1 of each step.
            fused: Stage 2 of each step.
            check: Called now and then; raises to stop.
            corrections: What a person said; given only where there is any.
            earlier: Of runs with the same boxes, tracks of the filter and stated places; given only
                where it is asked for.

        Returns:
            None where the filter's tracks stay as they are.
        """
        ...


class NoSmoothing:
    """The filter's tracks as they are: what a live system would see."""

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """There is nothing to prepare."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: Earlier | None = None,
    ) -> None:
        """Nothing is made of them."""

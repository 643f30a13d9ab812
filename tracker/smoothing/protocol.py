"""The interface of every smoothing method: all steps of the filter in, smoothed tracks out."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from typing import Protocol

from tracker.corrections import Correction
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.result import Smoothed


class SmoothingMethod(Protocol):
    """One method, prepared for one sequence."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
    ) -> Smoothed | None:
        """The tracks of some steps from step 0 on, each by the boxes of all of them.

        Args:
            views: Stage 1 of each step.
            fused: Stage 2 of each step.
            check: Called now and then; raises to stop.
            corrections: What a person said; given only where there is any.

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
    ) -> None:
        """Nothing is made of them."""


def create(sequence: Sequence, parameters: RunParameters) -> SmoothingMethod:
    """The smoothing method that the parameters name, prepared for a sequence."""
    method: SmoothingMethod = parameters.method("smoothing_method").load()(sequence, parameters)
    return method

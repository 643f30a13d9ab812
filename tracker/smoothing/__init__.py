"""Stage 3: smoothing of tracks over the whole recording: positions, ends, gaps, and identities.

The methods are described in :mod:`tracker.parameters.groups` and chosen in
:func:`maker`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tracker.smoothing.protocol import (
    Decision,
    DecisionKind,
    NoSmoothing,
    Smoothed,
    SmoothingMethod,
    names_of,
    tracks_of,
)

if TYPE_CHECKING:
    from tracker.parameters import Method
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.sequence import Sequence

__all__ = [
    "Decision", "DecisionKind", "Smoothed", "SmoothingMethod", "create", "maker", "names_of",
    "tracks_of",
]  # fmt: skip


def maker(method: Method) -> Callable[[Sequence, RunParameters], SmoothingMethod]:
    """The class of a method of stage 3, which is imported only when it is chosen."""
    match method.name:
        case "none":
            return NoSmoothing
        case "positions":
            from tracker.smoothing.stage import PositionSmoothing

            return PositionSmoothing
        case "identities":
            from tracker.smoothing.stage import IdentitySmoothing

            return IdentitySmoothing
    return method.load()


def create(sequence: Sequence, parameters: RunParameters) -> SmoothingMethod:
    """Create the smoothing method that the parameters name for a sequence."""
    return maker(parameters.method("smoothing_method"))(sequence, parameters)

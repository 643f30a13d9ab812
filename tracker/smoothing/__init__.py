"""Stage 3: the filter's tracks with hindsight: places, ends, gaps, and who is who.

The methods are described in :mod:`tracker.parameters.groups` and chosen in
:func:`~tracker.smoothing.protocol.maker`.
"""

from tracker.smoothing.protocol import SmoothingMethod, create, maker
from tracker.smoothing.result import Decision, DecisionKind, Smoothed
from tracker.smoothing.tracks import names_of, tracks_of

__all__ = [
    "Decision", "DecisionKind", "Smoothed", "SmoothingMethod", "create", "maker", "names_of",
    "tracks_of",
]  # fmt: skip

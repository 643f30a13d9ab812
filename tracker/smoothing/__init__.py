"""Stage 3: the filter's tracks with hindsight: places, ends, gaps, and who is who.

The methods are registered in :mod:`tracker.parameters.registry`.
"""

from tracker.smoothing.protocol import SmoothingMethod, create
from tracker.smoothing.result import Decision, DecisionKind, Smoothed
from tracker.smoothing.tracks import names_of, tracks_of

__all__ = [
    "Decision", "DecisionKind", "Smoothed", "SmoothingMethod", "create", "names_of", "tracks_of",
]  # fmt: skip

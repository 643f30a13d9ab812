"""Stage 3: the filter's tracks with hindsight: places, ends, gaps, and who is who."""

from tracker.smoothing.result import Decision, DecisionKind, Smoothed
from tracker.smoothing.stage import smooth
from tracker.smoothing.tracks import tracks_of

__all__ = ["Decision", "DecisionKind", "Smoothed", "smooth", "tracks_of"]

"""Parameters of the smoothing over the whole recording.

Numbers that are class variables are constants: over their ranges recall, false positives and IDF1
change by no more than they scatter (``tests/papers/rooms/fusion_constants.md``).
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from tracker.parameters.definition import Params, Topic, ui
from tracker.parameters.method import Method, Reads, Uses


class SmoothingParams(Params):
    """Smoothing of the tracks over all steps: positions, ends, gaps and identities."""

    topic: ClassVar[Topic] = "Extraction"

    iterations: ClassVar[int] = 2
    """Number of times that boxes are associated with the smoothed tracks, and tracks fitted to
    them."""

    learning: Annotated[bool, ui("s, b, f")] = True
    """Whether people's heights and process noise, the cameras' offsets and noise, and the offset of
    boxes from the templates are estimated."""

    memory: ClassVar[float] = 0.25
    """Correlation time of a camera's boxes and misses, within which they count as one observation,
    seconds."""

    change: Annotated[float, Field(ge=0.0, le=20.0), ui("c", step=0.5)] = 4.0
    """Log odds against a person becoming absent within a track, and against a return."""

    ambiguity_threshold: Annotated[float, Field(ge=0.05, le=1.0), ui("d", step=0.05)] = 0.6
    """Identities: a track is split where this share of its boxes may as well belong to another
    track."""

    jump: Annotated[float, Field(ge=5.0, le=1000.0), ui("J", step=5.0, log=True)] = 40.0
    """Identities: squared Mahalanobis distance between past and future from which a track is
    split."""

    exchange: Annotated[float, Field(ge=-20.0, le=50.0), ui("x", step=0.5)] = -2.0
    """Identities: log odds of a swap of two tracks from which both are split, and then linked
    again."""

    longest: Annotated[float, Field(ge=0.1, le=60.0), ui("t_j", unit="s", step=0.5)] = 2.0
    """Identities: tracklets are linked by motion over gaps up to this, by appearance over
    longer."""

    rounds: ClassVar[int] = 2
    """Identities: number of resolutions, each from the tracks of the one before."""

    appearance: Annotated[float, Field(ge=0.0, le=5.0), ui("α", step=0.1)] = 1.0
    """Identities: weight of the appearance; 0 leaves it out."""


_IDENTITIES_ONLY = frozenset({"ambiguity_threshold", "jump", "exchange", "longest", "appearance"})

NONE = Method(
    name="none",
    help="The filter's tracks as they are: what a live system would see.",
)

POSITIONS = Method(
    name="positions",
    help="Each track of the filter, smoothed over its whole life.",
    uses=Uses(reads=(Reads("smoothing", without=_IDENTITIES_ONLY),)),
)

IDENTITIES = Method(
    name="identities",
    help="Smoothed, and identities resolved over the whole recording.",
    uses=Uses(reads=(Reads("smoothing"),)),
    resolves_identities=True,
)

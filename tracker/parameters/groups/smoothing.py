"""Parameters of the smoothing over the whole recording."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.methods import Method, Reads, Uses


class SmoothingParams(Params):
    """Smoothing of the tracks over all steps: positions, ends, gaps and identities."""

    iterations: Annotated[int, Field(ge=1, le=10), ui("n", step=1)] = 2
    """How often boxes are shared out anew by the smoothed tracks, and the tracks fitted to them."""

    learning: Annotated[bool, ui("s, b, f")] = True
    """Whether people's heights and process noise, the cameras' offsets and noise, and how low boxes
    lie against the templates are learnt."""

    memory: Annotated[float, Field(ge=0.05, le=10.0), ui("τ_z", unit="s", step=0.05, log=True)] = (
        0.25
    )
    """Correlation time of a camera's boxes and misses: within it they repeat each other."""

    change: Annotated[float, Field(ge=0.0, le=20.0), ui("c", step=0.5)] = 4.0
    """Log odds against a person's leaving within a track, and against a return."""

    reach: Annotated[float, Field(ge=0.0, le=10.0), ui("t_e", unit="s", step=0.1)] = 1.0
    """How far beyond its first and last box a track looks for more."""

    doubt: Annotated[float, Field(ge=0.05, le=1.0), ui("d", step=0.05)] = 0.6
    """Identities: a track is cut where so great a share of its boxes may as well be another's."""

    jump: Annotated[float, Field(ge=5.0, le=1000.0), ui("J", step=5.0, log=True)] = 40.0
    """Identities: squared Mahalanobis distance of past and future from which a track is cut."""

    exchange: Annotated[float, Field(ge=-20.0, le=50.0), ui("x", step=0.5)] = -2.0
    """Identities: log odds of two people exchanged from which both are cut, to be joined anew."""

    gap: Annotated[float, Field(ge=0.1, le=30.0), ui("t_g", unit="s", step=0.1)] = 1.0
    """Identities: a track is cut where nobody saw it for longer."""

    longest: Annotated[float, Field(ge=0.1, le=60.0), ui("t_j", unit="s", step=0.5)] = 2.0
    """Identities: pieces are joined by motion over gaps up to this, by appearance over longer."""

    keeping: Annotated[float, Field(ge=0.0, le=20.0), ui("k", step=0.5)] = 2.0
    """Identities: log odds with which the filter's label joins pieces over longer gaps."""

    rounds: Annotated[int, Field(ge=1, le=5), ui("n_i", step=1)] = 2
    """Identities: how often they are resolved, each time from the tracks of the time before."""

    appearance: Annotated[float, Field(ge=0.0, le=5.0), ui("α", step=0.1)] = 1.0
    """Identities: weight of the appearance; 0 leaves it out."""


_IDENTITIES_ONLY = frozenset(
    {"doubt", "jump", "exchange", "gap", "longest", "keeping", "rounds", "appearance"}
)

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
    settles_who=True,
)

"""Parameters of the single-view method that finds people by shape.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses


class ShapesParams(Params):
    """People by the shape of head and trunk, without templates ([DTPB09]).

    They are followed in the picture by ``jpda`` with its default parameters: halved and doubled,
    none of those and not the constant changed a bit of any track in six random rooms
    (``tests.papers.rooms.ablations``), since all people by shape go to the fusion.
    """

    least_odds: Annotated[float, Field(ge=-6.0, le=10.0), ui("ln o", step=0.1, essential=True)] = (
        0.5
    )
    """Log odds from which a window of the picture counts as a person in this camera."""

    passed_odds: Annotated[float, Field(ge=-6.0, le=10.0), ui("ln o_2", step=0.1)] = -1.5
    """Log odds from which a window is passed on to the fusion, where several cameras may agree on
    it."""

    even_odds: Annotated[float, Field(ge=-6.0, le=10.0), ui("ln o_0", step=0.1, advanced=True)] = (
        2.3
    )
    """Log odds at which a window that was passed on is equally likely a person and clutter."""

    odds_weight: Annotated[float, Field(ge=0.0, le=5.0), ui("a_s", step=0.1, advanced=True)] = 2.0
    """Factor from the log odds beyond the even ones to the log likelihood ratio of a person."""

    largest_ratio: Annotated[float, Field(ge=0.0, le=20.0), ui("ln Λ", step=0.1, advanced=True)] = (
        3.0
    )
    """Largest log likelihood ratio of a person that a shape alone can give."""

    overlap: Annotated[float, Field(ge=0.05, le=0.9), ui("o_s", step=0.05, advanced=True)] = 0.3
    """Intersection over union above which two windows are of one person; the better one remains."""

    place_sigma: Annotated[
        float, Field(ge=0.01, le=1.0), ui("σ_s", unit="m", step=0.01, log=True)
    ] = 0.08
    """Standard deviation of the place of a person in the picture, at the person's distance."""

    size_sigma: Annotated[
        float, Field(ge=0.01, le=3.0), ui("σ_h", unit="half sizes", step=0.01, log=True)
    ] = 0.2
    """Standard deviation of the half sizes of a person's box; the smaller, the more precise
    is the estimated depth."""

    pixel_sigma: Annotated[
        float, Field(ge=0.0, le=50.0), ui("σ_px", unit="px", step=0.1, advanced=True)
    ] = 1.5
    """Part of the noise of a person's place that does not depend on the person's size in the
    picture."""

    cover: ClassVar[float] = 2.0
    """An occluded person lies within so many half sizes of the box that hides the person."""


METHOD = Method(
    name="shapes",
    help="People by the shape of head and trunk, tracked in the picture by data association.",
    uses=Uses(pictures=True, reads=(Reads("shapes"), Reads("pictures"))),
    parameters=ShapesParams,
)

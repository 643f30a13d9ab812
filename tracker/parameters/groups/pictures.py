"""Parameters of how pictures are prepared for stage 1: scaled, turned upright and stabilised."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from tracker.parameters.definition import Params, ui


class PictureParams(Params):
    """Size and rotation of the pictures of stage 1; its boxes are converted back to full pixels.

    The class's constants were parameters. Halved and doubled, none changed the mean of recall,
    false positives a step or IDF1 by 0.005 in as many as two of the random rooms that the table of
    ``tests.papers.rooms.ablations`` lists, with any method.
    """

    lines: Annotated[int, Field(ge=120, le=4320), ui("n_l", unit="px", log=True)] = 480
    """A picture whose shorter side is longer than this is reduced to it."""

    target_height: ClassVar[int] = 160
    """A picture is reduced further, by a factor of two at most, until the median target is this
    high."""

    least_height: ClassVar[int] = 40
    """Least height of the median target to which a picture is reduced."""

    level_from: ClassVar[float] = 0.15
    """The picture of a camera that is rolled further than this is turned until people stand."""

    steady_from: Annotated[
        float, Field(ge=0.0, le=100.0), ui("σ_s", unit="px", step=0.05, advanced=True)
    ] = 0.25
    """The pictures of a camera that shakes by more than this, in reduced pixels, are stabilised."""

"""Parameters of the single-view tracker by association matrices.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses

_TARGETS = {"output": ("targets",)}


class AssociationMatrixParams(Params):
    """Single-view tracker by association matrices of foreground objects ([CMQ07])."""

    # The class constants are thresholds of the paper and no parameters: halved and doubled, none
    # changes the mean of recall, false positives a step or IDF1 by 0.005 in as many as two of the
    # random rooms that the table of `tests.papers.rooms.ablations` lists.

    reach: Annotated[
        float, Field(ge=0.1, le=10.0), ui("T_d", "Motion", unit="object sizes", step=0.1)
    ] = 1.0
    """While the number of objects stays the same: largest distance that one moves in a step, in
    roots of half width × half height."""

    overlap: Annotated[Literal["pixels", "boxes"], ui("O∩O", published="boxes")] = "pixels"
    """Where the number of objects changes: whether the pixels that two objects share count, or
    those of their boxes."""

    overlap_area: Annotated[int, Field(ge=0, le=5000), ui("T_s", unit="px", step=1)] = 30
    """Where the number of objects changes: objects of two steps that share more than this are
    one."""

    confirmation_steps: Annotated[
        int, Field(ge=1, le=100), ui("n_c", "Birth", unit="steps", step=1, published=1)
    ] = 5
    """A new target is confirmed once its object was alone for so long; a piece split off is not."""

    join_gap: Annotated[
        float, Field(ge=0.0, le=1.0), ui("g", unit="target heights", step=0.01, published=0.0)
    ] = 0.3
    """Pieces of foreground above each other, no further apart than this, are one object."""

    interrupted_steps: ClassVar[int] = 25
    """A track without an object for longer than this has ended."""

    return_similarity: ClassVar[float] = 0.6
    """An object continues an interrupted track if its colours are at least so similar."""

    follow_mild: Annotated[bool, ui("MS", "Motion")] = True
    """Whether two people who merge under mild occlusion are tracked separately by mean shift."""

    mild_share: ClassVar[float] = 0.8
    """Two people are mildly occluded if their merged object is larger than this share of both."""

    occlusion_distance: ClassVar[float] = 0.5
    """Two people who are tracked separately become one object once their centres are this near."""

    histogram_rate: ClassVar[float] = 0.1
    """Weight of the present colours in a track's colours, at each step in which it is alone."""

    output: Annotated[Literal["targets", "objects"], ui("Y", "Extraction", published="objects")] = (
        "targets"
    )
    """What goes to the fusion: target boxes fitted to the objects' outlines, or the objects."""

    acceptance: Annotated[
        float, Field(ge=-10.0, le=0.0), ui("s_min", step=0.1, when=_TARGETS, essential=True)
    ] = -2.0
    """Targets: least score of the best box of an object."""

    further_acceptance: Annotated[
        float, Field(ge=-10.0, le=0.0), ui("s_2", step=0.1, when=_TARGETS)
    ] = -1.7
    """Targets: least score of further boxes of an object, up to its number of tracks."""

    spare_acceptance: Annotated[
        float, Field(ge=-10.0, le=0.0), ui("s_+", step=0.1, when=_TARGETS)
    ] = -0.7
    """Targets: least score of boxes of an object beyond its number of tracks."""

    centre_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_x", unit="half sizes", step=0.01, log=True)
    ] = 0.25
    """Standard deviation of a box's centre."""

    size_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_h", unit="half sizes", step=0.01, log=True)
    ] = 0.2
    """Standard deviation of a box's half sizes."""

    straying: ClassVar[float] = 0.1
    """Growth of the distance at which an interrupted object may be found again, per step, as a
    share of its reach."""

    inside_weight: Annotated[
        float, Field(ge=0.0, le=20.0), ui("a", step=0.5, advanced=True, when=_TARGETS)
    ] = 3.0
    """Targets: weight of the foreground inside a box in its score."""

    around_weight: Annotated[
        float, Field(ge=0.0, le=20.0), ui("b", step=0.5, advanced=True, when=_TARGETS)
    ] = 3.0
    """Targets: weight of the foreground above and beside a box, which lowers its score."""

    least_inside: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_min", step=0.05, advanced=True, when=_TARGETS)
    ] = 0.4
    """Targets: a box with less foreground than this share of a person's outline is rejected."""

    averaging_width: Annotated[
        float,
        Field(ge=0.05, le=5.0),
        ui("h", unit="half sizes", step=0.05, advanced=True, when=_TARGETS),
    ] = 0.5
    """Targets: width over which boxes that fit nearly as well are averaged."""

    apart: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("d", unit="half sizes", step=0.1, advanced=True, when=_TARGETS),
    ] = 1.0
    """Targets: the least distance between the centres of two boxes."""


METHOD = Method(
    name="association_matrix",
    help="Tracks of foreground objects by decision matrices.",
    uses=Uses(
        pictures=True,
        reads=(Reads("association_matrix"), Reads("pictures"), Reads("foreground")),
    ),
    parameters=AssociationMatrixParams,
)

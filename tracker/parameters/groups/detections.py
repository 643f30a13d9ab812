"""Parameters of the single-view methods on an outside detector's boxes."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses


class DetectionBoxParams(Params):
    """A detector's boxes: their noise, and their places in the room.

    The constant was a parameter. Halved and doubled, every track stayed the same to the bit in
    four random rooms (``tests.papers.rooms.ablations``): three deviations allow for all but one
    box in 370.
    """

    depth_sigmas: ClassVar[float] = 3.0
    """Largest error of a box's size, in standard deviations, for the check whether its target can
    stand in the room."""

    score_threshold: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s_min", "Clutter", step=0.01, essential=True)
    ] = 0.0
    """Boxes with a lower score are left out."""

    room_tolerance: Annotated[
        float, Field(ge=0.0, le=100.0), ui("d_r", "Birth", unit="m", step=0.1)
    ] = 1.0
    """A box whose target would stand further outside the room's volume than this is clutter."""

    centre_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_x", unit="half heights", step=0.01, log=True)
    ] = 0.08
    """Standard deviation of a box's centre, across and down, as a share of its half height."""

    size_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_h", unit="half heights", step=0.01, log=True)
    ] = 0.12
    """Standard deviation of a box's half height, as a share of it; the smaller, the more precise
    is the estimated depth."""

    width_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_b", unit="half widths", step=0.01, log=True)
    ] = 0.3
    """Standard deviation of a box's half width, as a share of it; arms and turning change it. The
    fusion uses widths for the measurement box_and_width alone."""

    pixel_sigma: Annotated[float, Field(ge=0.0, le=50.0), ui("σ_px", unit="px", step=0.1)] = 1.5
    """Part of the noise of a box's centre and half sizes that does not depend on the box's size."""


class DetectionPhdParams(Params):
    """Single-view GM-PHD filter on an outside detector's boxes.

    The class's constants were parameters. Halved and doubled, or their distances from 1, none
    changed recall, false positives a step or IDF1 by as much as 0.003 in six random rooms, two of
    which were chosen for four people and more (``tests.papers.rooms.ablations``): the boxes go to
    the fusion, and the filter decides only which of them no target explains.
    """

    survival_probability: ClassVar[float] = 0.99
    """Probability that a person in the picture is still there a step later."""

    detection_probability: ClassVar[float] = 0.9
    """Probability that a person in the picture gets a box."""

    clutter_rate: ClassVar[float] = 1.0
    """λ_c: expected number of false boxes in a step, uniform over the picture and the sizes."""

    score_clutter: ClassVar[float] = 1.0
    """b_s: how much likelier a box of low score is clutter."""

    birth_rate: ClassVar[float] = 1.0
    """γ: expected number of people who appear in one second at a box that no component
    explained."""

    motion_sigma: ClassVar[float] = 0.5
    """σ_w: standard deviation of a person's displacement in the picture in one second, half
    heights."""

    growth_sigma: ClassVar[float] = 0.2
    """σ_H: standard deviation of the change of a box's half sizes in one second, half sizes."""

    gate_probability: ClassVar[float] = 0.9999
    """Probability that a person's own box lies in the gate."""

    pruning_threshold: ClassVar[float] = 1e-4
    """Components lighter than this are dropped."""

    merging_threshold: ClassVar[float] = 4.0
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: ClassVar[int] = 60
    """Number of the heaviest components that are kept."""

    extraction_threshold: ClassVar[float] = 0.5
    """A component whose weight is above this is a 2D estimate."""

    output: Annotated[
        Literal["boxes", "estimates"], ui("Y", "Extraction", published="estimates")
    ] = "boxes"
    """What goes to the fusion: the boxes that more likely are of a target than not, or the
    estimates."""


AS_THEY_ARE = Method(
    name="none",
    help="An outside detector's boxes, without a filter in the picture.",
    uses=Uses(detections=True, reads=(Reads("detection_boxes"),)),
    parameters=DetectionBoxParams,
    group="detection_boxes",
)

FILTERED = Method(
    name="detection_phd",
    help="GM-PHD filter on an outside detector's boxes.",
    uses=Uses(detections=True, reads=(Reads("detection_boxes"), Reads("detection_phd"))),
    parameters=DetectionPhdParams,
)

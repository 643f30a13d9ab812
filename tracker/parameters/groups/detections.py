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

    The class's constants were parameters. Their distances from 0 or 1 halved and doubled, every
    track stayed the same to the bit in four random rooms (``tests.papers.rooms.ablations``) and
    in pieces of three recordings.
    """

    survival_probability: ClassVar[float] = 0.99
    """Probability that a person in the picture is still there a step later."""

    pruning_threshold: ClassVar[float] = 1e-4
    """Components lighter than this are dropped."""

    gate_probability: ClassVar[float] = 0.9999
    """Probability that a person's own box lies in the gate."""

    detection_probability: Annotated[float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01)] = 0.9
    """Probability that a person in the picture gets a box."""

    clutter_rate: Annotated[
        float, Field(ge=0.001, le=50.0), ui("λ_c", "Clutter", unit="1/step", step=0.1, log=True)
    ] = 1.0
    """Expected number of false boxes, uniform over the picture and the sizes."""

    score_clutter: Annotated[float, Field(ge=0.0, le=5.0), ui("b_s", "Clutter", step=0.1)] = 1.0
    """How much likelier a box of low score is clutter: the rate times exp(2 b_s (½ − score))."""

    birth_rate: Annotated[
        float, Field(ge=1e-3, le=50.0), ui("γ", "Birth", unit="1/(box·s)", log=True)
    ] = 1.0
    """Expected number of people who appear in one second at a box that no component explained."""

    motion_sigma: Annotated[
        float,
        Field(ge=0.05, le=50.0),
        ui("σ_w", "Motion", unit="half heights/√s", step=0.1, log=True),
    ] = 0.5
    """Random walk: standard deviation of a person's displacement in the picture in one second."""

    growth_sigma: Annotated[
        float,
        Field(ge=0.01, le=5.0),
        ui("σ_H", "Motion", unit="half sizes/√s", step=0.01, log=True),
    ] = 0.2
    """Random walk: standard deviation of the change of a box's half sizes in one second."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", "Extraction", step=0.5)] = (
        4.0
    )
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: Annotated[int, Field(ge=1, le=300), ui("J_max", "Extraction", step=1)] = 60
    """The heaviest components that are kept."""

    extraction_threshold: Annotated[
        float, Field(ge=0.01, le=0.99), ui("T_e", "Extraction", step=0.01)
    ] = 0.5
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

"""Parameters of the single-view methods on a detector's boxes: outside, a network, or shapes.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses, Values


class DetectionBoxParams(Params):
    """A detector's boxes: their noise, and their places in the room."""

    # The class constant is no parameter: halved and doubled, every track stays the same to the bit
    # in four random rooms (`tests.papers.rooms.ablations`): three deviations allow for all but one
    # box in 370.

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
    """Single-view GM-PHD filter on an outside detector's boxes."""

    # The class constants are no parameters: halved and doubled, or their distances from 1, none
    # changes recall, false positives a step or IDF1 by as much as 0.003 in six random rooms, two of
    # which were chosen for four people and more (`tests.papers.rooms.ablations`): the boxes go to
    # the fusion, and the filter decides only which of them no target explains.

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


class OnnxDetectorParams(Params):
    """Single-view boxes of a detection network (ONNX) that is run on the pictures."""

    score_threshold: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s_min", "Clutter", step=0.01, essential=True)
    ] = 0.35
    """Boxes with a lower score are left out."""

    suppression_overlap: Annotated[
        float, Field(ge=0.05, le=0.99), ui("o_s", step=0.01, essential=True)
    ] = 0.6
    """Of two boxes with a larger intersection over union the one with the higher score remains."""

    person_class: Annotated[int, Field(ge=-1, le=1000), ui("c", step=1, advanced=True)] = -1
    """Which of the network's classes are people, counted from 0; -1: by the kind of network."""

    input_side: Annotated[
        int, Field(ge=0, le=2048), ui("n_in", unit="px", step=32, advanced=True)
    ] = 0
    """Longer side of the network's picture, where its file leaves that open; 0: as the file says,
    416 for the fetched network, or else 640. The more, the smaller people may be, and the longer it
    takes."""

    every: Annotated[int, Field(ge=1, le=10), ui("n_e", unit="steps", step=1)] = 1
    """The network looks at every n-th picture; those between are no evidence for or against
    people."""

    pixel_values: Annotated[
        Literal["file", "unit", "imagenet", "signed", "bytes", "imagenet_bgr"],
        ui("v", advanced=True),
    ] = "file"
    """Range of the network's input: as its file says, or else 0 … 1; 0 … 1 (YOLO, RT-DETR),
    ImageNet's (DETR), −1 … 1, 0 … 255, or ImageNet's with blue first (NanoDet)."""


_BOXES = Reads("detection_boxes", without=frozenset({"score_threshold"}))
"""A network's boxes have the noise of every detector's, and a least score of their own."""

_PICTURES = Reads(
    "pictures", without=frozenset({"lines", "target_height", "least_height", "steady_from"})
)
"""The network's input is scaled from the full picture, and it needs no fixed background."""


def _uses(values: Values) -> Uses:
    return Uses(
        pictures=True,
        detector=True,
        every=values.of(OnnxDetectorParams).every,
        reads=(Reads("onnx_detector"), _BOXES, _PICTURES),
    )


DETECTED = Method(
    name="onnx_detector",
    help="The boxes of a detection network (ONNX), without a filter in the picture.",
    uses=_uses,
    parameters=OnnxDetectorParams,
)


class ShapesParams(Params):
    """People by the shape of head and trunk, without templates ([DTPB09])."""

    # The targets of `jpda` with default parameters follow them in the picture. Halved and doubled,
    # neither these parameters nor the class constant change any track in six random rooms
    # (`tests.papers.rooms.ablations`): all people by shape go to the fusion.

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


BY_SHAPE = Method(
    name="shapes",
    help="People by the shape of head and trunk, tracked in the picture by data association.",
    uses=Uses(pictures=True, reads=(Reads("shapes"), Reads("pictures"))),
    parameters=ShapesParams,
)

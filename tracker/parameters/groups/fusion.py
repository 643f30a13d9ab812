"""Parameters of the fusion of all cameras.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.

Numbers that are class variables are constants: over their ranges recall, false positives and IDF1
change by no more than they scatter (``tests/papers/rooms/fusion_constants.md``).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses, Values

_BOXES = {"measurement": ("box", "box_and_width")}
_RECOGNITION = {"recognition": (True,)}
_WALK, _VELOCITY = {"motion": ("random_walk",)}, {"motion": ("constant_velocity",)}


class FusionParams(Params):
    """Fusion of the cameras in 3D ([ZW21] §2.4)."""

    survival_probability: Annotated[
        float, Field(ge=0.5, le=1.0), ui("p_S", "Motion", step=0.001, essential=True)
    ] = 0.99
    """Probability that a person in the room is still there a step later."""

    detection_probability: Annotated[
        float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01, published=0.98, essential=True)
    ] = 0.95
    """Probability that a camera's boxes include a person that its picture holds."""

    clutter_rate: Annotated[
        float,
        Field(ge=0.001, le=50.0),
        ui(
            "λ_c",
            "Clutter",
            unit="1/(camera·step)",
            step=0.1,
            log=True,
            published=0.5,
            essential=True,
            slider=(0.1, 10.0, 0.1),
        ),
    ] = 3.0
    """Expected number of false boxes that a camera gives at each step."""

    birth_rate: Annotated[
        float,
        Field(ge=1e-4, le=10.0),
        ui(
            "γ",
            "Birth",
            unit="1/(entrance·s)",
            log=True,
            published=0.5,
            essential=True,
            slider=(0.01, 1.0, 0.01),
        ),
    ] = 0.05
    """Expected number of people who come in at each entrance in one second."""

    measurement: Annotated[
        Literal["centre", "box", "box_and_width"], ui("z", published="centre")
    ] = "box"
    """What is used of a box: its centre; its horizontal centre, top and bottom; and its width."""

    posture_share: Annotated[
        float, Field(ge=0.0, le=0.5), ui("ε", step=0.01, published=0.0, when=_BOXES)
    ] = 0.1
    """Share of the boxes that show a person lying, crouching or bent; 0 if all people stand."""

    update: Annotated[Literal["extended", "unscented"], ui("h(x)")] = "extended"
    """How the nonlinear projection is handled: linearised at the mean, or by unscented points."""

    motion: Annotated[
        Literal["random_walk", "constant_velocity"], ui("F", "Motion", published="random_walk")
    ] = "constant_velocity"
    """How people move between two steps."""

    motion_sigma: Annotated[
        float,
        Field(ge=0.01, le=3.0),
        ui("σ_w", "Motion", unit="m/√s", step=0.01, log=True, when=_WALK),
    ] = 0.4
    """Random walk: standard deviation of a person's displacement in one second, along each axis."""

    acceleration_sigma: Annotated[
        float,
        Field(ge=0.05, le=10.0),
        ui(
            "σ_a",
            "Motion",
            unit="m/s per √s",
            step=0.05,
            log=True,
            when=_VELOCITY,
            essential=True,
            slider=(0.05, 3.0, 0.05),
        ),
    ] = 0.6
    """Constant velocity: standard deviation of the change of a person's velocity in one second,
    along each horizontal axis."""

    vertical_share: ClassVar[float] = 0.1
    """Constant velocity: σ_a along the vertical axis, as a share of that along the floor."""

    velocity_memory: Annotated[
        float,
        Field(ge=0.1, le=100.0),
        ui("τ", "Motion", unit="s", step=0.1, log=True, when=_VELOCITY),
    ] = 2.0
    """Constant velocity: time after which a person who is not seen has slowed to a third."""

    start_velocity: ClassVar[float] = 0.7
    """Constant velocity: standard deviation of a new target's velocity along each axis, around 0,
    m/s."""

    birth: Annotated[
        Literal["entrances", "measurements", "both"], ui("γ(x)", "Birth", published="entrances")
    ] = "both"
    """Where people may appear: at the entrances, where boxes of two cameras agree, or both."""

    misses: Annotated[Literal["per_camera", "per_person"], ui("1−p_D", published="per_camera")] = (
        "per_person"
    )
    """Sequential PHD: a miss scales weights by 1 − p_D, or a label's existence by Bayes' rule."""

    occlusion: Annotated[float, Field(ge=0.0, le=1.0), ui("ρ", step=0.05, published=0.0)] = 0.8
    """Share by which p_D falls where a person is wholly covered by another."""

    edge: Annotated[Literal["soft", "hard"], ui("∂I", published="hard")] = "soft"
    """Whether p_D falls towards the picture's edge with a target's uncertainty, or ends there."""

    duplicate_distance: Annotated[float, Field(ge=0.0, le=2.0), ui("d_2", "Clutter", step=0.05)] = (
        0.5
    )
    """Tracks nearer than this share of a target's width, without a box each, are one person."""

    room_margin: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("m", "Extraction", unit="m", step=0.05, stage="tracks", published=0.1),
    ] = 0.0
    """How far outside the room's volume a person is still reported."""

    followed_margin: Annotated[
        float, Field(ge=0.0, le=5.0), ui("m_f", "Motion", unit="m", step=0.05, published=0.6)
    ] = 0.5
    """How far outside the room people are tracked, unreported, so their boxes start no track."""

    memory: Annotated[
        float,
        Field(ge=0.0, le=30.0),
        ui("t_m", "Motion", unit="s", step=0.1, published=0.0, essential=True),
    ] = 3.0
    """How long a person whom no camera sees may be gone and still come back under the same id."""

    recognition: Annotated[bool, ui("π", "Motion", published=False)] = True
    """Multi-Bernoulli: whether colours tell people apart, also when a person who left returns."""

    measurement_sigma: Annotated[float, Field(ge=0.1, le=10.0), ui("σ_v", step=0.1, log=True)] = 1.0
    """Factor on the noise that the single-view stage states for its boxes."""

    gate_probability: ClassVar[float] = 0.9999
    """Probability that a person's own box lies inside the gate."""

    pruning_threshold: Annotated[float, Field(ge=1e-8, le=0.1), ui("T", "Extraction", log=True)] = (
        1e-4
    )
    """Components lighter than this are dropped."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", "Extraction", step=0.5)] = (
        4.0
    )
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: Annotated[int, Field(ge=5, le=500), ui("J_max", "Extraction", step=1)] = 60
    """Largest number of components; the heaviest ones remain."""

    extraction: Annotated[
        Literal["components", "boxes"],
        ui("W_z", "Extraction", stage="tracks", published="components"),
    ] = "components"
    """Sequential PHD: whether the components that one box made are reported singly or as one."""

    extraction_threshold: Annotated[
        float,
        Field(ge=0.01, le=0.99),
        ui("T_e", "Extraction", step=0.01, stage="tracks", essential=True),
    ] = 0.5
    """A component whose weight is above this is reported as a person."""

    posture_height: Annotated[
        float,
        Field(ge=0.1, le=1.0),
        ui("h_p", unit="half heights", step=0.05, advanced=True, when=_BOXES),
    ] = 0.5
    """Other posture: half height of the target, relative to the upright one's half height."""

    posture_width: ClassVar[float] = 0.6
    """Other posture: half width of the target, relative to the upright one's half height."""

    posture_centre_sigma: ClassVar[float] = 0.15
    """Other posture: standard deviation of the box's centre, across and down, half heights."""

    posture_width_sigma: ClassVar[float] = 0.5
    """Other posture: standard deviation of the box's half width, half heights."""

    posture_height_sigma: ClassVar[float] = 0.25
    """Other posture: standard deviation of the box's half height, half heights."""

    posture_drop: ClassVar[float] = 0.3
    """Other posture: standard deviation of the vertical displacement of the person's centre, half
    heights."""

    memory_gate_probability: ClassVar[float] = 0.9
    """Probability that a person who comes back is within the gate of the predicted position."""

    recognition_outlier_probability: Annotated[
        float,
        Field(ge=0.0, le=1.0),
        ui("ε_r", "Motion", step=0.01, advanced=True, when=_RECOGNITION),
    ] = 0.1
    """Recognition: probability that a box's colours are uninformative about the person."""

    recognition_interval: Annotated[
        float,
        Field(ge=0.01, le=60.0),
        ui("τ_r", "Motion", unit="s", log=True, advanced=True, when=_RECOGNITION),
    ] = 1.0
    """Recognition: pictures within this time are alike and count as one observation of colours."""

    recognition_swap: ClassVar[float] = 30.0
    """Recognition: time constant with which earlier evidence of a track's identity fades,
    seconds."""

    recognition_odds: Annotated[
        float,
        Field(ge=1.0, le=10000.0),
        ui("o_s", "Motion", log=True, advanced=True, when=_RECOGNITION),
    ] = 20.0
    """Recognition: least odds of the best assignment of ids against the best without a pair, for
    the pair to be accepted."""

    recognition_own_odds: ClassVar[float] = 3.0
    """Recognition: least odds of a track's colours, for one person against every other, for it to
    get that person's id."""


def _multi_bernoulli_uses(parameters: Values) -> Uses:
    without = {"misses", "extraction"}
    if parameters.of(FusionParams).birth == "measurements":
        without.add("merging_threshold")  # of the people not yet detected, of whom there are none
    return Uses(reads=(Reads("fusion", without=frozenset(without)),))


_RECOGNITION_ONLY = frozenset(
    name for name in FusionParams.model_fields if name.startswith("recognition")
)

SEQUENTIAL_PHD = Method(
    name="sequential_phd",
    help="GM-PHD filter updated by one camera after another.",
    uses=Uses(reads=(Reads("fusion", without=_RECOGNITION_ONLY),)),
)

MULTI_BERNOULLI = Method(
    name="multi_bernoulli",
    help="Poisson multi-Bernoulli filter with belief propagation.",
    uses=_multi_bernoulli_uses,
)

"""Parameters of the single-view tracker by joint probabilistic data association.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.groups.colour_phd import ColourPeakParams
from tracker.parameters.method import Method, Reads, Uses, Values

_FOREGROUND = {"measurements": ("foreground",)}
_CROWNS = {**_FOREGROUND, "foreground_box": ("target",)}
_FIVE = {"five_cases": (True,)}


class JpdaParams(Params):
    """Single-view tracker by joint probabilistic data association, with five cases ([WW10])."""

    # The class constants are no parameters: halved and doubled, none changes the mean of recall,
    # false positives a step or IDF1 by 0.005 in as many as two of the random rooms that the table
    # of `tests.papers.rooms.ablations` lists.

    measurements: Annotated[Literal["foreground", "colour", "detections"], ui("Z")] = "foreground"
    """What is associated: boxes of the foreground, peaks of the colour likelihood, or an outside
    detector's boxes."""

    foreground_box: Annotated[
        Literal["target", "piece"], ui("z", "Foreground", published="piece", when=_FOREGROUND)
    ] = "target"
    """Box of a foreground measurement: a target under each top of a piece, or the whole piece."""

    association: Annotated[
        Literal["exact", "murty", "simplified_murty"], ui("β", published="simplified_murty")
    ] = "exact"
    """Joint events that are summed over: all of them, the K best, or n + M that share no pair."""

    events: Annotated[
        int, Field(ge=1, le=500), ui("K", log=True, advanced=True, when={"association": ("murty",)})
    ] = 30
    """For murty: how many of the best joint events count."""

    five_cases: Annotated[bool, ui("Ω")] = True
    """Whether occlusions, splits and returns are treated apart; off is the classical filter."""

    gate_probability: Annotated[
        float, Field(ge=0.5, le=0.99999), ui("P_G", step=0.001, essential=True)
    ] = 0.99
    """Probability that a target's own measurement lies in its gate."""

    detection_probability: Annotated[float, Field(ge=0.05, le=0.999), ui("P_D", step=0.01)] = 0.9
    """Probability that a person in the picture makes a measurement."""

    clutter: Annotated[
        Literal["poisson", "diffuse"], ui("g(Φ)", "Clutter", published="diffuse")
    ] = "poisson"
    """Model of the number of false measurements: Poisson with a known mean, or nothing is known."""

    clutter_rate: Annotated[
        float,
        Field(ge=0.001, le=50.0),
        ui("λ_c", "Clutter", unit="1/step", step=0.1, log=True, when={"clutter": ("poisson",)}),
    ] = 0.5
    """For poisson: expected number of false measurements, uniform over the picture."""

    acceleration_sigma: Annotated[
        float,
        Field(ge=0.1, le=200.0),
        ui("σ_a", "Motion", unit="half sizes/s^1.5", step=0.1, log=True),
    ] = 8.0
    """Standard deviation of the change of a person's velocity in the picture in one second."""

    velocity_sigma: Annotated[
        float, Field(ge=0.1, le=100.0), ui("σ_v", "Motion", unit="half sizes/s", step=0.1, log=True)
    ] = 6.0
    """Standard deviation of a new target's velocity along each axis, around 0."""

    centre_sigma: Annotated[
        float,
        Field(ge=0.01, le=3.0),
        ui("σ_x", unit="half sizes", step=0.01, log=True, when=_FOREGROUND),
    ] = 0.15
    """Standard deviation of the centre of a foreground box."""

    size_sigma: Annotated[
        float,
        Field(ge=0.01, le=3.0),
        ui("σ_h", unit="half sizes", step=0.01, log=True, when=_FOREGROUND),
    ] = 0.2
    """Standard deviation of the half sizes of a foreground box; the smaller, the more precise
    is the estimated depth."""

    pixel_sigma: Annotated[
        float, Field(ge=0.0, le=50.0), ui("σ_px", unit="px", step=0.1, when=_FOREGROUND)
    ] = 2.5
    """Part of the noise of a foreground box's centre that does not depend on the box's size."""

    size_rate: Annotated[float, Field(ge=0.01, le=1.0), ui("α", "Motion", step=0.01)] = 0.2
    """Weight of a measurement's size in the smoothed size of its target, at each step."""

    least_probability: Annotated[
        float, Field(ge=0.0, le=0.9), ui("β_min", "Clutter", step=0.01, published=0.0, when=_FIVE)
    ] = 0.1
    """Entries of the association matrix up to this count as 0 in the choice of each target's
    case."""

    occlusion: Annotated[
        Literal["inside", "measurement"], ui("x|z", published="measurement", when=_FIVE)
    ] = "inside"
    """Where occluded targets are: predicted inside the piece of foreground that hides them, or at
    rest at the one measurement that lies in all their gates."""

    vanish_steps: ClassVar[int] = 3
    """A target without measurement at so many steps in a row has vanished."""

    return_steps: ClassVar[int] = 5
    """A new target in the gate of one that vanished at most so many steps ago continues it."""

    confirmation_steps: Annotated[
        int, Field(ge=1, le=50), ui("k_n", "Birth", unit="steps", step=1, published=1)
    ] = 5
    """A new target is confirmed once it was measured at so many steps in a row."""

    output: Annotated[
        Literal["estimates", "measurements"], ui("Y", "Extraction", published="estimates")
    ] = "estimates"
    """What goes to the fusion: the targets' boxes, or the measurements that belong to targets."""

    longest_hidden: ClassVar[float] = 4.0
    """A target that stays occluded for longer than this is dropped."""

    same_size: Annotated[
        float, Field(ge=1.0, le=5.0), ui("k_m", step=0.1, advanced=True, when=_FIVE)
    ] = 1.5
    """A measurement larger or smaller than its target by this factor is not of this target
    alone."""

    leap: Annotated[
        float,
        Field(ge=0.0, le=10.0),
        ui("k_l", "Motion", unit="half sizes", step=0.1, advanced=True, when=_FIVE),
    ] = 2.0
    """A target in a merged piece takes a measurement outside its gate if it is this near."""

    one_side: Annotated[
        float, Field(ge=1.0, le=10.0), ui("k_e", step=0.1, advanced=True, when=_FIVE)
    ] = 2.0
    """A hidden target is placed at an edge of its piece of foreground if the boxes measured there
    leave more than this factor as much space at that edge as at the opposite one."""

    cover: Annotated[
        float,
        Field(ge=1.0, le=10.0),
        ui(
            "k_c",
            unit="half sizes",
            step=0.1,
            advanced=True,
            when={"measurements": ("colour", "detections")},
        ),
    ] = 2.0
    """Without foreground, a hidden target lies within so many half sizes of the box that hides
    it."""

    height_sigmas: Annotated[
        float, Field(ge=0.0, le=10.0), ui("k_z", step=0.5, advanced=True, when=_CROWNS)
    ] = 2.0
    """Range of a target's height around that of the entrances, or of people on the floor where
    there are none, in standard deviations."""

    crack: Annotated[
        float,
        Field(ge=0.0, le=2.0),
        ui("h_c", unit="half heights", step=0.05, advanced=True, when=_CROWNS),
    ] = 0.5
    """Gaps across a piece up to this height, as between head and shirt, are closed."""

    top_reach: Annotated[
        float,
        Field(ge=0.1, le=5.0),
        ui("w_t", unit="half widths", step=0.1, advanced=True, when=_CROWNS),
    ] = 1.2
    """The pixels below the top of a piece, up to so many half widths aside, are of its target."""

    least_inside: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_i", step=0.05, advanced=True, when=_CROWNS)
    ] = 0.4
    """A box with less foreground than this share of a person's outline in it is of no target."""

    most_above: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_a", step=0.05, advanced=True, when=_CROWNS)
    ] = 0.5
    """A box with a larger share of foreground above it is of no target."""

    most_beside: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_b", step=0.05, advanced=True, when=_CROWNS)
    ] = 0.8
    """A box with a larger share of foreground beside its upper part is of no target."""

    shoulder_across: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("w_s", unit="half widths", step=0.1, advanced=True, when=_CROWNS),
    ] = 1.0
    """Largest distance aside of a target's top at which another top may be its shoulder."""

    shoulder_down: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("h_s", unit="half heights", step=0.1, advanced=True, when=_CROWNS),
    ] = 1.5
    """Largest distance below a target's top at which another top may be its shoulder."""


def _uses(parameters: Values) -> Uses:
    """Return what the method uses with the chosen kind of measurements."""
    source = parameters.of(JpdaParams).measurements
    own = Reads("jpda")
    if source == "detections":
        return Uses(detections=True, reads=(own, Reads("detection_boxes")))
    if source == "foreground":
        return Uses(pictures=True, reads=(own, Reads("pictures"), Reads("foreground")))
    # without a single template the foreground's boxes are taken instead
    walk = frozenset({"motion_sigma", "growth_sigma"})  # its targets have a motion of their own
    colours = Reads("colour_phd", only=ColourPeakParams, without=walk)
    reads = (own, Reads("pictures"), Reads("foreground"), colours)
    return Uses(pictures=True, templates="if there", reads=reads)


METHOD = Method(
    name="jpda",
    help="Joint probabilistic data association with five cases.",
    uses=_uses,
    parameters=JpdaParams,
)

"""Numbers of the single-view tracker by joint probabilistic data association.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui


class JpdaParams(Params):
    """Single-view tracker by joint probabilistic data association, with five cases ([WW10])."""

    measurements: Annotated[Literal["foreground", "colour", "detections"], ui("Z")] = "foreground"
    """What is associated: boxes of the foreground, peaks of the colour likelihood, or an outside
    detector's boxes."""

    foreground_box: Annotated[Literal["target", "piece"], ui("z", published="piece")] = "target"
    """Box of a foreground measurement: a target under each top of a piece, or the whole piece."""

    association: Annotated[
        Literal["exact", "murty", "simplified_murty"], ui("β", published="simplified_murty")
    ] = "exact"
    """Over which joint events: all of them, the K best, or n + M that share no pair."""

    events: Annotated[int, Field(ge=1, le=500), ui("K", log=True, advanced=True)] = 30
    """For murty: how many of the best joint events count."""

    five_cases: Annotated[bool, ui("Ω")] = True
    """Whether occlusions, splits and returns are treated apart; off is the classical filter."""

    gate_probability: Annotated[
        float, Field(ge=0.5, le=0.99999), ui("P_G", step=0.001, essential=True)
    ] = 0.99
    """Probability that a target's own measurement lies in its gate."""

    detection_probability: Annotated[float, Field(ge=0.05, le=0.999), ui("P_D", step=0.01)] = 0.9
    """Probability that a person in the picture makes a measurement."""

    clutter: Annotated[Literal["poisson", "diffuse"], ui("g(Φ)", published="diffuse")] = "poisson"
    """What is known of the number of false measurements: its mean, or nothing at all."""

    clutter_rate: Annotated[
        float, Field(ge=0.001, le=50.0), ui("λ_c", unit="1/step", step=0.1, log=True)
    ] = 0.5
    """For poisson: expected number of measurements that are nobody, uniform over the picture."""

    gate_volume: Annotated[
        float, Field(ge=1.0, le=1000.0), ui("V", unit="√|S|", log=True, advanced=True)
    ] = 9.5
    """For diffuse: volume of a gate, in which a false measurement is uniform, in standard
    deviations of the innovation."""

    acceleration_sigma: Annotated[
        float, Field(ge=0.1, le=200.0), ui("σ_a", unit="half sizes/s^1.5", step=0.1, log=True)
    ] = 8.0
    """How much a person's velocity in the picture changes in one second."""

    velocity_sigma: Annotated[
        float, Field(ge=0.1, le=100.0), ui("σ_v", unit="half sizes/s", step=0.1, log=True)
    ] = 6.0
    """How fast a newcomer may move, who is taken to stand still."""

    centre_sigma: Annotated[
        float, Field(ge=0.01, le=3.0), ui("σ_x", unit="half sizes", step=0.01, log=True)
    ] = 0.15
    """Standard deviation of the centre of a foreground box."""

    size_sigma: Annotated[
        float, Field(ge=0.01, le=3.0), ui("σ_h", unit="half sizes", step=0.01, log=True)
    ] = 0.2
    """Standard deviation of the half sizes of a foreground box: how far they tell depth."""

    pixel_sigma: Annotated[float, Field(ge=0.0, le=50.0), ui("σ_px", unit="px", step=0.1)] = 2.5
    """Noise of a foreground box's centre however small it is; it adds to the share."""

    size_rate: Annotated[float, Field(ge=0.01, le=1.0), ui("α", step=0.01)] = 0.2
    """How far a target's box takes the size of its measurement in one step."""

    least_probability: Annotated[
        float, Field(ge=0.0, le=0.9), ui("β_min", step=0.01, published=0.0)
    ] = 0.1
    """Entries of the association matrix up to this count as 0 when the cases are told apart."""

    occlusion: Annotated[Literal["inside", "measurement"], ui("x|z", published="measurement")] = (
        "inside"
    )
    """Who is hidden by another goes on inside the piece; or all whose gates meet in one
    measurement take its place and stand still."""

    vanish_steps: Annotated[int, Field(ge=1, le=100), ui("k_v", unit="steps", step=1)] = 3
    """A target without measurement at so many steps in a row has vanished."""

    return_steps: Annotated[int, Field(ge=0, le=250), ui("k_s", unit="steps", step=1)] = 5
    """A newcomer where somebody vanished at most so many steps ago is the same person."""

    confirmation_steps: Annotated[
        int, Field(ge=1, le=50), ui("k_n", unit="steps", step=1, published=1)
    ] = 5
    """A newcomer counts once measured at so many steps in a row."""

    output: Annotated[Literal["estimates", "measurements"], ui("Y", published="estimates")] = (
        "estimates"
    )
    """What goes to the fusion: the targets' boxes, or the measurements that are somebody's."""

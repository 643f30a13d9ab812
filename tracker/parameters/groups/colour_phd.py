"""Parameters of the single-view GM-PHD filter on colour.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
[VM06] Vo, Ma, "The Gaussian mixture probability hypothesis density filter", IEEE TSP
54(11), 2006.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.method import Method, Reads, Uses, Values


class ColourBoxParams(Params):
    """Boxes with the colours of templates: what all methods on colours have in common."""

    colour_space: Annotated[Literal["hue_saturation", "rgb"], ui("u", published="rgb")] = (
        "hue_saturation"
    )
    """Bins of the histograms: 16 hues × 16 saturations and 16 greys, or RGB 8×8×8."""

    histogram_kernel: Annotated[Literal["epanechnikov", "flat"], ui("k(r)", published="flat")] = (
        "epanechnikov"
    )
    """How a box's pixels count: less towards the edge of the ellipse in it, or all the same."""

    acceptance_foreground: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_min", "Foreground", step=0.01, published=0.0)
    ] = 0.35
    """A peak or mode with a smaller share of foreground in its box is rejected."""

    foreground_weight: Annotated[
        float, Field(ge=0.0, le=10.0), ui("a", "Foreground", step=0.1, published=0.0)
    ] = 3.0
    """The likelihood is multiplied by the share of foreground in the box to this power."""

    surroundings_weight: Annotated[
        float, Field(ge=0.0, le=10.0), ui("b", step=0.1, published=0.0)
    ] = 3.0
    """The likelihood falls by exp(-b · share of foreground above and beside the box)."""

    samples: Annotated[int, Field(ge=20, le=5000), ui("S", unit="1/(camera·step)", log=True)] = 400
    """Boxes, or particles of all targets together, that are compared with the templates."""

    motion_sigma: Annotated[
        float, Field(ge=0.1, le=50.0), ui("σ_w", "Motion", unit="half sizes/√s", step=0.1, log=True)
    ] = 3.0
    """Random walk: standard deviation of a person's displacement in the picture in one second."""

    growth_sigma: Annotated[
        float,
        Field(ge=0.01, le=5.0),
        ui("σ_H", "Motion", unit="half sizes/√s", step=0.01, log=True),
    ] = 0.4
    """Random walk: standard deviation of the change of a box's half sizes in one second."""

    centre_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_x", unit="half sizes", step=0.01, log=True)
    ] = 0.5
    """Standard deviation of the centre of a peak or mode."""

    size_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_h", unit="half sizes", step=0.01, log=True)
    ] = 0.5
    """Standard deviation of the half sizes of a peak or mode, which colour hardly determines."""

    size_jitter: Annotated[float, Field(ge=0.0, le=1.0), ui("σ_s", step=0.01, advanced=True)] = 0.1
    """Relative spread of the samples' sizes around that of a target at the place: people differ."""

    @property
    def weighs_foreground(self) -> bool:
        """Whether the foreground in a box counts."""
        weights = (self.acceptance_foreground, self.foreground_weight, self.surroundings_weight)
        return max(weights) > 0.0


class ColourPeakParams(ColourBoxParams):
    """Peaks of the colour likelihood ([ZW21] §2.2)."""

    # The class constants here and of the filter are no parameters: halved and doubled, none changes
    # the mean of recall, false positives a step or IDF1 by 0.005 in as many as two of the random
    # rooms that the table of `tests.papers.rooms.ablations` lists.

    likelihood_sigma: Annotated[float, Field(ge=0.02, le=0.5), ui("σ", step=0.01)] = 0.1
    """Spread of the distance D to the nearest template in the colour likelihood N(D; 0, σ²)."""

    acceptance_distance: Annotated[
        float, Field(ge=0.05, le=1.0), ui("D_max", step=0.01, published=1.0, essential=True)
    ] = 0.52
    """A peak is rejected if its likelihood, that of its foreground included, is below the colour
    likelihood at this distance."""

    carry_templates: Annotated[bool, ui("q_c", published=False)] = True
    """Whether a camera without a template of a person gets one at the place that the calibration
    and the templates in other cameras predict."""

    shapes: Annotated[
        Literal["never", "unsure", "fitting", "always"], ui("S_h", published="never")
    ] = "unsure"
    """When people detected by shape count as well. Unsure: where the foreground misses a person, or
    where templates are few and shapes agree with them. Fitting: there, and wherever shapes agree
    with the templates."""

    shape_odds: Annotated[
        float,
        Field(ge=-6.0, le=10.0),
        ui("ln o", step=0.1, when={"shapes": ("unsure", "fitting", "always")}),
    ] = 2.0
    """Log odds from which a person detected by shape is passed on like a peak."""

    foreground_samples: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s", "Foreground", step=0.05, published=0.0)
    ] = 0.5
    """Share of the samples drawn anywhere on the foreground; the rest from the prediction."""

    peaks_per_person: Annotated[bool, ui("l_z", published=False)] = True
    """Whether peaks are sought for each person's templates by themselves, not for all at once."""

    mean_shift_starts: Annotated[int, Field(ge=1, le=100), ui("K", step=1)] = 20
    """Largest number of samples from which the search for peaks starts."""

    spread_starts: Annotated[bool, ui("K_s", "Birth", published=False)] = True
    """Whether starts keep apart; if not, the heaviest samples are used, which are often all on one
    person."""

    bandwidth: Annotated[
        float, Field(ge=0.1, le=3.0), ui("h", unit="half sizes", step=0.05, log=True)
    ] = 0.8
    """Width of the mean shift's kernel."""

    sigma_height: Annotated[
        float, Field(ge=5.0, le=1000.0), ui("h_σ", unit="px", log=True, advanced=True)
    ] = 60.0
    """Half height up to which a peak's deviations grow with its size: a large target shows
    details."""

    merge_distance: Annotated[
        float,
        Field(ge=0.1, le=5.0),
        ui("d_m", "Clutter", unit="half sizes", step=0.1, advanced=True),
    ] = 0.8
    """Climbs that end nearer to each other than this are one peak."""

    same_person_distance: ClassVar[float] = 1.5
    """Least distance between two peaks of one person's colours."""

    @property
    def asks_foreground(self) -> bool:
        """Whether any parameter makes use of the foreground."""
        return self.weighs_foreground or self.foreground_samples > 0.0


class ColourPhdParams(ColourPeakParams):
    """Single-view GM-PHD filter on colour likelihood ([ZW21] §2.1–2.3)."""

    extraction_threshold: ClassVar[float] = 0.5
    """A component whose weight is above this is a 2D estimate: more likely than not there is
    somebody ([VM06]). By default no estimate goes to the fusion."""

    survival_probability: Annotated[
        float, Field(ge=0.5, le=1.0), ui("p_S", "Motion", step=0.001)
    ] = 0.99
    """Probability that a person in the picture is still there a step later."""

    detection_probability: Annotated[
        float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01, published=0.98)
    ] = 0.8
    """Probability that a person in the picture makes a colour peak."""

    birth: Annotated[
        Literal["peaks", "entrances", "both"], ui("γ(x)", "Birth", published="entrances")
    ] = "peaks"
    """Where people may appear: at peaks that no component explained, at the entrances, or both."""

    birth_rate: Annotated[
        float, Field(ge=1e-3, le=50.0), ui("γ", "Birth", unit="1/(place·s)", log=True)
    ] = 1.0
    """Expected number of people who appear at each such place in one second."""

    clutter_rate: Annotated[
        float, Field(ge=0.001, le=50.0), ui("λ_c", "Clutter", unit="1/step", step=0.1, log=True)
    ] = 1.0
    """Expected number of false peaks, uniform over the picture and the sizes."""

    pruning_threshold: Annotated[float, Field(ge=1e-8, le=0.1), ui("T", "Extraction", log=True)] = (
        1e-4
    )
    """Components lighter than this are dropped."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", "Extraction", step=0.5)] = (
        4.0
    )
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: ClassVar[int] = 30
    """The heaviest components that are kept."""

    output: Annotated[
        Literal["peaks", "estimates"], ui("Y", "Extraction", published="estimates")
    ] = "peaks"
    """What goes to the fusion: this step's peaks, which lag less, or the filter's estimates."""

    gate_probability: ClassVar[float] = 0.9999
    """Probability that a person's own peak lies in the gate."""


def _uses(parameters: Values) -> Uses:
    asked = parameters.of(ColourPhdParams).asks_foreground
    foreground = parameters.of(ForegroundParams).read_by_colours if asked else ()
    reads = (Reads("colour_phd"), Reads("pictures"), *foreground)
    return Uses(pictures=True, templates="needed", reads=reads)


METHOD = Method(
    name="colour_phd",
    help="GM-PHD filter on peaks of the colour likelihood.",
    uses=_uses,
    parameters=ColourPhdParams,
)

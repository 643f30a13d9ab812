"""Parameters of the particle filters on colour.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008. A field's
``published`` value makes the scheme of that paper: particles are drawn anew at a target's
radius; λ and d_0, for flat RGB histograms, and h near that radius are chosen on rendered clips.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.groups.colour_phd import ColourBoxParams, ColourPhdParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.method import Method, Reads, Uses, Values

_PSEUDO = {"filter": ("pseudo",)}


class PseudoParticleParams(Params):
    """Single-view pseudo particle filter, and the classical one beside it ([SG08])."""

    # The class constants are no parameters: halved and doubled, none changes the mean of recall,
    # false positives a step or IDF1 by 0.005 in as many as two of the random rooms that the table
    # of `tests.papers.rooms.ablations` lists.

    filter: Annotated[Literal["pseudo", "classical"], ui("p(x|z)")] = "pseudo"
    """Clusters of particles as targets, or one posterior whose mean is the only one."""

    sharpness: Annotated[
        float, Field(ge=1.0, le=200.0), ui("λ", step=1.0, log=True, published=20.0)
    ] = 40.0
    """How fast a particle's weight exp(-λ d) falls with the distance d to a target's colours."""

    birth: Annotated[Literal["foreground", "picture"], ui("γ(x)", "Birth", published="picture")] = (
        "foreground"
    )
    """Where particles look for new targets: on the foreground, or anywhere in the picture."""

    newcomer_share: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s", "Birth", step=0.05, when=_PSEUDO)
    ] = 0.4
    """Share of the particles that look for new targets; all do while there is no target."""

    resampling: Annotated[
        Literal["each", "together"], ui("w_i", "Extraction", published="together", when=_PSEUDO)
    ] = "each"
    """Whether each target's particles, and the newcomers', keep their number, or all compete."""

    velocity_share: Annotated[
        float, Field(ge=0.0, le=1.0), ui("v", "Motion", step=0.05, published=0.0, when=_PSEUDO)
    ] = 0.8
    """Share of its mean displacement that a target repeats at each step; 0 is a random walk."""

    clusters: Annotated[
        Literal["each", "together"], ui("m", published="together", when=_PSEUDO)
    ] = "each"
    """Whether particles cluster with those of the same person's colours only, or with all."""

    bandwidth: Annotated[
        float,
        Field(ge=0.2, le=3.0),
        ui("h", unit="half sizes", step=0.05, log=True, published=0.7, when=_PSEUDO),
    ] = 1.0
    """Radius of the mean shift's kernel; it follows the size of the target."""

    smallest_cluster: ClassVar[float] = 0.01
    """A cluster with a smaller share of the particles is dropped."""

    redistribution: Annotated[
        float,
        Field(ge=0.0, le=3.0),
        ui("σ_r", "Extraction", unit="half sizes", step=0.05, published=1.0, when=_PSEUDO),
    ] = 0.7
    """Spread of the particles that are drawn anew around each target; 0 keeps the resampled."""

    acceptance_distance: Annotated[
        float, Field(ge=0.05, le=1.0), ui("d_0", step=0.01, published=0.6, essential=True)
    ] = 0.5
    """Colour distance of the background: a mode less likely than a box at this distance is
    background."""

    position_sigma: Annotated[
        float,
        Field(ge=0.1, le=10.0),
        ui("σ_a", unit="half sizes", step=0.1, log=True, when=_PSEUDO),
    ] = 1.0
    """Standard deviation of a mode's centre around the predicted centre of its target."""

    separation: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("r_n", "Clutter", unit="half sizes", step=0.1, published=0.0, when=_PSEUDO),
    ] = 2.0
    """Least distance of a new target's mode from that of another target."""

    targets_per_person: Annotated[
        int, Field(ge=1, le=10), ui("n_g", "Extraction", step=1, published=1, when=_PSEUDO)
    ] = 2
    """How many targets may look like one person's templates at a time."""

    confirmation: ClassVar[int] = 3
    """Number of steps at which a new target must be detected before it is confirmed."""

    patience: Annotated[
        float, Field(ge=0.0, le=10.0), ui("t_p", "Motion", unit="s", step=0.05, when=_PSEUDO)
    ] = 0.8
    """Time for which a target that is not detected is predicted before it has vanished."""

    memory: ClassVar[float] = 10.0
    """Time after a target vanished within which one of the same colours continues its id."""

    output: Annotated[
        Literal["modes", "targets"], ui("Y", "Extraction", published="targets", when=_PSEUDO)
    ] = "modes"
    """What goes to the fusion: every mode that is not background, or the confirmed targets."""

    merge_distance: Annotated[
        float,
        Field(ge=0.1, le=5.0),
        ui("d_m", "Clutter", unit="half sizes", step=0.1, advanced=True, when=_PSEUDO),
    ] = 1.0
    """Modes nearer to each other than this are one."""

    newcomer_misses: Annotated[
        int,
        Field(ge=1, le=50),
        ui("n_m", "Birth", unit="steps", step=1, advanced=True, when=_PSEUDO),
    ] = 2
    """An unconfirmed target that is not detected at so many steps in a row ends."""

    velocity_memory: Annotated[
        float, Field(ge=0.0, le=0.99), ui("μ", "Motion", step=0.05, advanced=True, when=_PSEUDO)
    ] = 0.8
    """Weight of the old mean displacement at each new one."""

    position_gate: Annotated[
        float, Field(ge=0.5, le=10.0), ui("k_a", step=0.5, advanced=True, when=_PSEUDO)
    ] = 3.0
    """A target at an unknown place is as likely as one so many standard deviations σ_a away."""

    def asks_foreground(self, colours: ColourBoxParams) -> bool:
        """Whether any parameter makes use of the foreground."""
        return self.birth == "foreground" or colours.weighs_foreground


def _uses(parameters: Values) -> Uses:
    p = parameters.of(PseudoParticleParams)
    asked = p.asks_foreground(parameters.of(ColourPhdParams))
    foreground = parameters.of(ForegroundParams).read_by_colours if asked else ()
    # the one mean of the classical filter is no mode that could be rejected
    without = frozenset({"acceptance_foreground"} if p.filter == "classical" else ())
    colours = Reads("colour_phd", only=ColourBoxParams, without=without)
    reads = (Reads("pseudo_particle"), colours, Reads("pictures"), *foreground)
    return Uses(pictures=True, templates="needed", reads=reads)


METHOD = Method(
    name="pseudo_particle",
    help="Particle filter on colour whose clusters are the targets.",
    uses=_uses,
    parameters=PseudoParticleParams,
)

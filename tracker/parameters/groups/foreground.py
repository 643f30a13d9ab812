"""Parameters of the pictures of stage 1, and of the foreground segmentation.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tracker.parameters.definition import Params, Topic, ui
from tracker.parameters.method import Reads


class PictureParams(Params):
    """Size and rotation of the pictures of stage 1; its boxes are converted back to full pixels."""

    # The class constants are no parameters: halved and doubled, none changes the mean of recall,
    # false positives a step or IDF1 by 0.005 in as many as two of the random rooms that the table
    # of `tests.papers.rooms.ablations` lists, with any method.

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


_LEARNT, _ADAPTIVE = {"model": ("learnt",)}, {"model": ("adaptive",)}

_MOTION = frozenset({"restless_from", "restless_to", "motion_memory", "motion_threshold"})
"""The parameters of the memory of motion."""


class ForegroundParams(Params):
    """Foreground of a picture, for every method that looks at it ([CMQ07])."""

    topic: ClassVar[Topic] = "Foreground"

    model: Annotated[Literal["learnt", "adaptive"], ui("M", published="adaptive")] = "learnt"
    """A background learnt once from the clip and one threshold, or the c-means of [CMQ07]."""

    threshold: Annotated[
        float, Field(ge=2.0, le=128.0), ui("θ", unit="16 √level", step=1.0, when=_LEARNT)
    ] = 24.0
    """Learnt: a pixel that differs more than this from the background is foreground."""

    restless_from: Annotated[
        float, Field(ge=0.0, le=1.0), ui("u_0", step=0.01, advanced=True, when=_LEARNT)
    ] = 0.25
    """Learnt: share of the changing pixels that are often away from their median, above which the
    background is uncertain."""

    restless_to: Annotated[
        float, Field(ge=0.0, le=1.0), ui("u_1", step=0.01, advanced=True, when=_LEARNT)
    ] = 0.35
    """Learnt: the same share from which the background is wholly uncertain, since people stay in
    one place, and motion is remembered for the full time."""

    motion_memory: Annotated[
        float, Field(ge=0.0, le=4.0), ui("T_m", unit="s", step=0.1, published=0.0, when=_LEARNT)
    ] = 0.6
    """Learnt: pixels that changed within this time are foreground as well, where the background is
    wholly uncertain; where it is less so, within a share of it."""

    motion_threshold: Annotated[
        float,
        Field(ge=2.0, le=128.0),
        ui("θ_m", unit="16 √level", step=1.0, advanced=True, when=_LEARNT),
    ] = 14.0
    """Learnt: a pixel that differs more than this from a tenth of a second ago changed."""

    deviation_ratio: Annotated[
        float, Field(ge=0.1, le=10.0), ui("σ_b/σ_f", step=0.1, log=True, when=_ADAPTIVE)
    ] = 3.0
    """Adaptive: the background's deviation over the foreground's; more makes less foreground."""

    least_threshold: Annotated[
        float,
        Field(ge=0.0, le=100.0),
        ui("t_min", unit="grey levels", step=1.0, published=0.0, when=_ADAPTIVE),
    ] = 20.0
    """Adaptive: a difference below this is noise, whatever the classes say."""

    follow_exposure: Annotated[bool, ui("I/M", published=False, when=_ADAPTIVE)] = True
    """Adaptive: whether the background is brought to each picture's exposure."""

    drop_shadows: Annotated[bool, ui("S", published=False, when=_ADAPTIVE)] = True
    """Adaptive: whether an even loss of light is no difference."""

    minimum_area: Annotated[int, Field(ge=1, le=5000), ui("A_min", unit="px", log=True)] = 40
    """Smaller pieces of foreground are dropped."""

    darkest_shadow: Annotated[float, Field(ge=0.0, le=1.0), ui("s_l", step=0.01, advanced=True)] = (
        0.65
    )
    """A shadow leaves at least this share of the light."""

    shadow_tint: Annotated[float, Field(ge=0.0, le=1.0), ui("s_t", step=0.01, advanced=True)] = 0.08
    """The shares of light that a shadow leaves in the three channels differ by at most this."""

    # Without this rule, and as published, 0.04 to 0.53 of ten grey, white or covered pictures is
    # foreground in the built-in rooms, and with it nothing; with the matched exposure, the default,
    # nothing is foreground without it either.
    blank_deviation: Annotated[
        float,
        Field(ge=0.0, le=50.0),
        ui("σ_0", unit="grey levels", step=0.5, advanced=True, when=_ADAPTIVE),
    ] = 4.0
    """Adaptive: a picture whose grey levels deviate by less than this is blank and skipped."""

    @property
    def read_by_colours(self) -> tuple[Reads, ...]:
        """What a method on colour reads of this group.

        Such a method knows people by their colours, so it needs no memory of motion for those who
        stay. It uses the mask alone, not its connected components, of which the learnt background
        drops none.
        """
        without = _MOTION | {"minimum_area"} if self.model == "learnt" else _MOTION
        return (Reads("foreground", without=without),)

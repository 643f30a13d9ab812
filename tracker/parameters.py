"""Every tunable number, once: default, range, unit, symbol, help and stage.

From these definitions come the sliders, the command-line flags, the table of
``multiview-phd parameters``, the schema of the API and the cache keys.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021. A field's ``published`` value is the one of that paper,
where ours differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

Stage = Literal["single_view", "fusion", "tracks"]
SingleViewName = Literal["colour_phd", "detection_phd", "none"]
FusionName = Literal["sequential_phd", "multi_bernoulli"]


def ui(
    symbol: str,
    *,
    unit: str = "",
    step: float | None = None,
    log: bool = False,
    stage: Stage | None = None,
    published: Any = None,
    advanced: bool = False,
) -> Any:
    """What a parameter's face needs beyond its range and help.

    Args:
        symbol: As the formulas write it, for instance ``p_S``.
        unit: Empty for plain numbers.
        step: Of the slider.
        log: Whether the slider is logarithmic; the range must be positive.
        stage: The first stage that a change re-runs, where it is not the group's.
        published: The value of the ``published`` preset, where it differs from the default.
        advanced: Whether the page folds it away at first.
    """
    extra = {
        "symbol": symbol,
        "unit": unit,
        "step": step,
        "log": log,
        "stage": stage,
        "published": published,
        "advanced": advanced,
    }
    return Field(json_schema_extra={"x-ui": extra})


class Params(BaseModel):
    """A group of parameters. Values are checked, never changed in place."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        validate_default=True,
    )


class ColourPhdParams(Params):
    """Single-view GM-PHD filter on colour likelihood ([ZW21] §2.1–2.3)."""

    survival_probability: Annotated[float, Field(ge=0.5, le=1.0), ui("p_S", step=0.001)] = 0.99
    """Probability that a person in the picture is still there a step later."""

    detection_probability: Annotated[
        float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01, published=0.98)
    ] = 0.8
    """Probability that a person in the picture makes a colour peak."""

    colour_space: Annotated[Literal["hue_saturation", "rgb"], ui("u", published="rgb")] = (
        "hue_saturation"
    )
    """Bins of the histograms: 16 hues × 16 saturations and 16 greys, or RGB 8×8×8."""

    histogram_kernel: Annotated[Literal["epanechnikov", "flat"], ui("k(r)", published="flat")] = (
        "epanechnikov"
    )
    """How a box's pixels count: less towards the edge of the ellipse in it, or all the same."""

    likelihood_sigma: Annotated[float, Field(ge=0.02, le=0.5), ui("σ", step=0.01)] = 0.1
    """Spread of the distance D to the nearest template in the colour likelihood N(D; 0, σ²)."""

    acceptance_distance: Annotated[
        float, Field(ge=0.05, le=1.0), ui("D_max", step=0.01, published=1.0)
    ] = 0.52
    """A peak less likely, with its foreground, than a box at this distance is not taken."""

    acceptance_foreground: Annotated[
        float, Field(ge=0.0, le=1.0), ui("f_min", step=0.01, published=0.0)
    ] = 0.35
    """A peak with a smaller share of foreground in its box is not taken."""

    foreground_threshold: Annotated[
        float, Field(ge=2.0, le=128.0), ui("θ", unit="16 √level", step=1.0)
    ] = 24.0
    """A pixel that differs more than this from the background is foreground."""

    foreground_weight: Annotated[
        float, Field(ge=0.0, le=10.0), ui("a", step=0.1, published=0.0)
    ] = 3.0
    """The likelihood is multiplied by the share of foreground in the box to this power."""

    surroundings_weight: Annotated[
        float, Field(ge=0.0, le=10.0), ui("b", step=0.1, published=0.0)
    ] = 3.0
    """The likelihood falls by exp(-b · share of foreground above and beside the box)."""

    samples: Annotated[int, Field(ge=20, le=5000), ui("S", unit="1/(camera·step)", log=True)] = 400
    """Boxes that are compared with the templates."""

    foreground_samples: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s", step=0.05, published=0.0)
    ] = 0.5
    """Share of the samples drawn anywhere on the foreground; the rest from the prediction."""

    peaks_per_person: Annotated[bool, ui("l_z", published=False)] = True
    """Whether peaks are sought for each person's templates by themselves, not for all at once."""

    mean_shift_starts: Annotated[int, Field(ge=1, le=100), ui("K", step=1)] = 20
    """Samples at most from which the search for peaks starts."""

    spread_starts: Annotated[bool, ui("K_s", published=False)] = True
    """Whether starts keep apart; else the heaviest samples are taken, often all on one person."""

    bandwidth: Annotated[
        float, Field(ge=0.1, le=3.0), ui("h", unit="half sizes", step=0.05, log=True)
    ] = 0.8
    """Width of the mean shift's kernel."""

    motion_sigma: Annotated[
        float, Field(ge=0.1, le=50.0), ui("σ_w", unit="half sizes/√s", step=0.1, log=True)
    ] = 3.0
    """How far a person strays in the picture in one second."""

    growth_sigma: Annotated[
        float, Field(ge=0.01, le=5.0), ui("σ_H", unit="half sizes/√s", step=0.01, log=True)
    ] = 0.4
    """How much a person's box grows or shrinks in one second."""

    birth: Annotated[Literal["peaks", "entrances", "both"], ui("γ(x)", published="entrances")] = (
        "peaks"
    )
    """Where people may appear: at peaks that nothing explained, at the entrances, or both."""

    birth_rate: Annotated[float, Field(ge=1e-3, le=50.0), ui("γ", unit="1/(place·s)", log=True)] = (
        1.0
    )
    """Expected number of people who appear at each such place in one second."""

    clutter_rate: Annotated[
        float, Field(ge=0.001, le=50.0), ui("λ_c", unit="1/step", step=0.1, log=True)
    ] = 1.0
    """Expected number of peaks that are nobody, uniform over the picture and the sizes."""

    centre_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_x", unit="half sizes", step=0.01, log=True)
    ] = 0.5
    """Standard deviation of a peak's centre."""

    size_sigma: Annotated[
        float, Field(ge=0.02, le=3.0), ui("σ_h", unit="half sizes", step=0.01, log=True)
    ] = 0.5
    """Standard deviation of a peak's half sizes: colour alone hardly tells them."""

    pruning_threshold: Annotated[float, Field(ge=1e-8, le=0.1), ui("T", log=True)] = 1e-4
    """Components lighter than this are dropped."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", step=0.5)] = 4.0
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: Annotated[int, Field(ge=1, le=300), ui("J_max", step=1)] = 30
    """The heaviest components that are kept."""

    extraction_threshold: Annotated[float, Field(ge=0.01, le=0.99), ui("T_e", step=0.01)] = 0.5
    """A component whose weight is above this is a 2D estimate."""

    output: Annotated[Literal["peaks", "estimates"], ui("Y", published="estimates")] = "peaks"
    """What goes to the fusion: this step's peaks, which lag less, or the filter's estimates."""


class DetectionBoxParams(Params):
    """An outside detector's boxes, as they are."""

    score_threshold: Annotated[float, Field(ge=0.0, le=1.0), ui("s_min", step=0.01)] = 0.0
    """Boxes with a lower score are left out."""

    room_tolerance: Annotated[float, Field(ge=0.0, le=100.0), ui("d_r", unit="m", step=0.1)] = 1.0
    """A box whose target would stand further outside the room's volume than this is clutter."""

    centre_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_x", unit="half heights", step=0.01, log=True)
    ] = 0.08
    """Standard deviation of a box's centre, across and down, as a share of its half height."""

    size_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_h", unit="half heights", step=0.01, log=True)
    ] = 0.12
    """Standard deviation of a box's half height, as a share of it: how far its edges tell depth."""

    width_sigma: Annotated[
        float, Field(ge=0.005, le=3.0), ui("σ_b", unit="half widths", step=0.01, log=True)
    ] = 0.3
    """Standard deviation of a box's half width, as a share of it: arms and turning change it."""

    pixel_sigma: Annotated[float, Field(ge=0.0, le=50.0), ui("σ_px", unit="px", step=0.1)] = 1.5
    """Noise of a box's centre and half sizes however small it is; it adds to the shares."""


class DetectionPhdParams(DetectionBoxParams):
    """Single-view GM-PHD filter on an outside detector's boxes."""

    survival_probability: Annotated[float, Field(ge=0.5, le=1.0), ui("p_S", step=0.001)] = 0.99
    """Probability that a person in the picture is still there a step later."""

    detection_probability: Annotated[float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01)] = 0.9
    """Probability that a person in the picture gets a box."""

    clutter_rate: Annotated[
        float, Field(ge=0.001, le=50.0), ui("λ_c", unit="1/step", step=0.1, log=True)
    ] = 1.0
    """Expected number of boxes that are nobody, uniform over the picture and the sizes."""

    score_clutter: Annotated[float, Field(ge=0.0, le=5.0), ui("b_s", step=0.1)] = 1.0
    """How much likelier a box of low score is clutter: the rate times exp(2 b_s (½ − score))."""

    birth_rate: Annotated[float, Field(ge=1e-3, le=50.0), ui("γ", unit="1/(box·s)", log=True)] = 1.0
    """Expected number of people who appear in one second at a box that nobody explained."""

    motion_sigma: Annotated[
        float, Field(ge=0.05, le=50.0), ui("σ_w", unit="half heights/√s", step=0.1, log=True)
    ] = 0.5
    """How far a person strays in the picture in one second."""

    growth_sigma: Annotated[
        float, Field(ge=0.01, le=5.0), ui("σ_H", unit="half sizes/√s", step=0.01, log=True)
    ] = 0.2
    """How much a person's box grows or shrinks in one second."""

    pruning_threshold: Annotated[float, Field(ge=1e-8, le=0.1), ui("T", log=True)] = 1e-4
    """Components lighter than this are dropped."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", step=0.5)] = 4.0
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: Annotated[int, Field(ge=1, le=300), ui("J_max", step=1)] = 60
    """The heaviest components that are kept."""

    extraction_threshold: Annotated[float, Field(ge=0.01, le=0.99), ui("T_e", step=0.01)] = 0.5
    """A component whose weight is above this is a 2D estimate."""

    output: Annotated[Literal["boxes", "estimates"], ui("Y", published="estimates")] = "boxes"
    """What goes to the fusion: the boxes that the filter believes in, or its estimates."""


class FusionParams(Params):
    """Fusion of the cameras in 3D ([ZW21] §2.4)."""

    survival_probability: Annotated[float, Field(ge=0.5, le=1.0), ui("p_S", step=0.001)] = 0.99
    """Probability that a person in the room is still there a step later."""

    detection_probability: Annotated[float, Field(ge=0.05, le=1.0), ui("p_D", step=0.01)] = 0.98
    """Probability that a camera's boxes include a person that its picture holds."""

    clutter_rate: Annotated[
        float,
        Field(ge=0.001, le=50.0),
        ui("λ_c", unit="1/(camera·step)", step=0.1, log=True, published=0.5),
    ] = 3.0
    """Expected number of false boxes that a camera gives at each step."""

    birth_rate: Annotated[
        float, Field(ge=1e-4, le=10.0), ui("γ", unit="1/(entrance·s)", log=True, published=0.5)
    ] = 0.05
    """Expected number of people who come in at each entrance in one second."""

    measurement: Annotated[
        Literal["centre", "box", "box_and_width"], ui("z", published="centre")
    ] = "box"
    """What is used of a box: its centre; its horizontal centre, top and bottom; and its width."""

    update: Annotated[Literal["extended", "unscented"], ui("h(x)")] = "extended"
    """How the bend of the projection is met: a straight line at the mean, or unscented points."""

    motion: Annotated[
        Literal["random_walk", "constant_velocity"], ui("F", published="random_walk")
    ] = "constant_velocity"
    """How people move between two steps."""

    motion_sigma: Annotated[
        float, Field(ge=0.01, le=3.0), ui("σ_w", unit="m/√s", step=0.01, log=True)
    ] = 0.4
    """Random walk: how far a person strays in one second, along each axis."""

    acceleration_sigma: Annotated[
        float, Field(ge=0.05, le=10.0), ui("σ_a", unit="m/s per √s", step=0.05, log=True)
    ] = 0.8
    """Constant velocity: how much a person's speed changes in one second, along each axis."""

    vertical_share: Annotated[float, Field(ge=0.01, le=1.0), ui("σ_z/σ_x", step=0.01)] = 0.2
    """Constant velocity: how lively the height is, relative to the ground plane."""

    velocity_memory: Annotated[
        float, Field(ge=0.1, le=100.0), ui("τ", unit="s", step=0.1, log=True)
    ] = 2.0
    """Constant velocity: time after which a person who is not seen has slowed to a third."""

    start_velocity: Annotated[float, Field(ge=0.0, le=5.0), ui("σ_v0", unit="m/s", step=0.1)] = 0.7
    """Constant velocity: spread of a newcomer's speed along each axis."""

    birth: Annotated[
        Literal["entrances", "measurements", "both"], ui("γ(x)", published="entrances")
    ] = "both"
    """Where people may appear: at the entrances, where boxes of two cameras agree, or both."""

    misses: Annotated[Literal["per_camera", "per_person"], ui("1−p_D", published="per_camera")] = (
        "per_person"
    )
    """Sequential PHD: whether a miss forgets what other cameras saw, or a label is one person."""

    occlusion: Annotated[float, Field(ge=0.0, le=1.0), ui("ρ", step=0.05, published=0.0)] = 0.8
    """How surely a camera misses a person who is wholly covered by another."""

    edge: Annotated[Literal["soft", "hard"], ui("∂I", published="hard")] = "soft"
    """Whether p_D falls towards the picture's edge with a target's uncertainty, or ends there."""

    duplicate_distance: Annotated[float, Field(ge=0.0, le=2.0), ui("d_2", step=0.05)] = 0.5
    """Tracks nearer than this share of a target's width, without a box each, are one person."""

    room_margin: Annotated[
        float,
        Field(ge=0.0, le=5.0),
        ui("m", unit="m", step=0.05, stage="tracks", published=0.1),
    ] = 0.0
    """How far outside the room's volume a person is still reported."""

    followed_margin: Annotated[
        float, Field(ge=0.0, le=5.0), ui("m_f", unit="m", step=0.05, published=0.6)
    ] = 0.5
    """How far outside the room people are followed, unreported, so that their boxes are theirs."""

    memory: Annotated[
        float, Field(ge=0.0, le=30.0), ui("t_m", unit="s", step=0.1, published=0.0)
    ] = 3.0
    """How long a person whom no camera sees may be gone and still come back under the same id."""

    measurement_sigma: Annotated[float, Field(ge=0.1, le=10.0), ui("σ_v", step=0.1, log=True)] = 1.0
    """Factor on the noise that the single-view stage states for its boxes."""

    gate_probability: Annotated[float, Field(ge=0.5, le=1.0), ui("P_G", step=0.0001)] = 0.9999
    """Probability that a person's own box lies inside the gate; 1 switches gating off."""

    pruning_threshold: Annotated[float, Field(ge=1e-8, le=0.1), ui("T", log=True)] = 1e-4
    """Components lighter than this are dropped."""

    merging_threshold: Annotated[float, Field(ge=0.0, le=50.0), ui("U", step=0.5)] = 4.0
    """Squared Mahalanobis distance within which a component joins a heavier one."""

    max_components: Annotated[int, Field(ge=5, le=500), ui("J_max", step=1)] = 60
    """The heaviest components that are kept."""

    extraction: Annotated[
        Literal["components", "boxes"], ui("W_z", stage="tracks", published="components")
    ] = "components"
    """Sequential PHD: whether the components that one box made are reported singly or as one."""

    extraction_threshold: Annotated[
        float, Field(ge=0.01, le=0.99), ui("T_e", step=0.01, stage="tracks")
    ] = 0.5
    """A component whose weight is above this is reported as a person."""


class RunParameters(Params):
    """Everything that a run depends on, besides the sequence and the seed."""

    single_view: SingleViewName = "colour_phd"
    """Method of stage 1: boxes from each camera's pictures, or a detector's, filtered or not."""

    fusion_method: FusionName = "sequential_phd"
    """Method of stage 2: how the cameras' boxes become 3D positions."""

    colour_phd: ColourPhdParams = ColourPhdParams()
    detection_boxes: DetectionBoxParams = DetectionBoxParams()
    detection_phd: DetectionPhdParams = DetectionPhdParams()
    fusion: FusionParams = FusionParams()


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as its faces see it."""

    key: str
    """``group.name``, for instance ``fusion.survival_probability``."""
    group: str
    name: str
    label: str
    """The name in words."""
    help: str
    symbol: str
    unit: str
    stage: Stage
    kind: Literal["float", "int", "bool", "choice"]
    default: Any
    minimum: float | None
    maximum: float | None
    step: float | None
    log: bool
    choices: tuple[str, ...]
    published: Any
    advanced: bool


def _group_stage(group: str) -> Stage:
    return "fusion" if group == "fusion" else "single_view"


def _describe(group: str, name: str, field: FieldInfo) -> Parameter:
    assert isinstance(field.json_schema_extra, dict)
    extra: Any = field.json_schema_extra["x-ui"]
    bounds: dict[str, Any] = {}
    for item in field.metadata:
        bounds.update({k: getattr(item, k) for k in ("ge", "le") if hasattr(item, k)})
    annotation = field.annotation
    kind: Literal["float", "int", "bool", "choice"] = "choice"
    if annotation is float:
        kind = "float"
    elif annotation is int:
        kind = "int"
    elif annotation is bool:
        kind = "bool"
    return Parameter(
        key=f"{group}.{name}",
        group=group,
        name=name,
        label=name.replace("_", " ").capitalize(),
        help=field.description or "",
        symbol=extra["symbol"],
        unit=extra["unit"],
        stage=extra["stage"] or _group_stage(group),
        kind=kind,
        default=field.default,
        minimum=bounds.get("ge"),
        maximum=bounds.get("le"),
        step=extra["step"],
        log=extra["log"],
        choices=tuple(get_args(annotation)) if kind == "choice" else (),
        published=extra["published"],
        advanced=extra["advanced"],
    )


def _collect() -> Iterator[Parameter]:
    for group, group_field in RunParameters.model_fields.items():
        model = group_field.annotation
        if isinstance(model, type) and issubclass(model, Params):
            for name, field in model.model_fields.items():
                yield _describe(group, name, field)


PARAMETERS: dict[str, Parameter] = {p.key: p for p in _collect()}
"""Every parameter by its key, in the order of definition."""

GROUPS: dict[str, str] = {
    name: (field.annotation.__doc__ or "").strip()
    for name, field in RunParameters.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, Params)
}
"""Every group of parameters and what it is for."""

METHODS: dict[str, tuple[str, ...]] = {
    "single_view": get_args(SingleViewName),
    "fusion_method": get_args(FusionName),
}
"""The methods that can be chosen for stage 1 and stage 2."""

PRESETS: dict[str, dict[str, Any]] = {
    "robust": {},
    "published": {
        **{key: p.published for key, p in PARAMETERS.items() if p.published is not None},
        "fusion_method": "sequential_phd",
    },
}
"""Named sets of values, each against the defaults: ``robust`` is the defaults themselves."""


class ParameterError(ValueError):
    """A parameter does not exist or its value is out of range; the message says what to do."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(f"{key}: {message}")
        self.key = key


def value(parameters: RunParameters, key: str) -> Any:
    """The value of one parameter (``group.name``), or of a method choice."""
    if key in METHODS:
        return getattr(parameters, key)
    return getattr(getattr(parameters, key.split(".")[0]), key.split(".", 1)[1])


def with_values(parameters: RunParameters, changes: Mapping[str, Any]) -> RunParameters:
    """The parameters with some values changed, all checked.

    Args:
        parameters: What to start from.
        changes: By key; numbers may come as text, as on a command line.

    Raises:
        ParameterError: If a key does not exist or a value does not fit, with its range.
    """
    data = parameters.model_dump()
    for key, new in changes.items():
        if key in METHODS:
            if new not in METHODS[key]:
                raise ParameterError(key, f"expected one of {', '.join(METHODS[key])}, got {new!r}")
            data[key] = new
        elif key in PARAMETERS:
            group, name = key.split(".", 1)
            data[group][name] = _checked(PARAMETERS[key], new)
        else:
            raise ParameterError(key, _unknown(key))
    return RunParameters.model_validate(data)


def _unknown(key: str) -> str:
    import difflib

    near = difflib.get_close_matches(key, [*PARAMETERS, *METHODS], n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"there is no such parameter; {hint}`multiview-phd parameters` lists them all"


def _checked(parameter: Parameter, new: Any) -> Any:
    if parameter.kind == "choice":
        if new not in parameter.choices:
            choices = ", ".join(parameter.choices)
            raise ParameterError(parameter.key, f"expected one of {choices}, got {new!r}")
        return new
    if parameter.kind == "bool":
        words = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}
        known = words.get(str(new).lower())
        if known is None:
            raise ParameterError(parameter.key, f"expected true or false, got {new!r}")
        return known
    try:
        if isinstance(new, bool):
            raise TypeError
        number = float(new)
    except (TypeError, ValueError):
        raise ParameterError(parameter.key, f"expected a number, got {new!r}") from None
    if parameter.kind == "int":
        if number != int(number) if abs(number) < 1e18 else True:
            raise ParameterError(parameter.key, f"expected a whole number, got {new!r}")
        number = int(number)
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    if not parameter.minimum <= number <= parameter.maximum:
        unit = f" {parameter.unit}" if parameter.unit else ""
        raise ParameterError(
            parameter.key,
            f"must be between {parameter.minimum:g} and {parameter.maximum:g}{unit}, got {new}",
        )
    return number


def changed(parameters: RunParameters, reference: RunParameters | None = None) -> dict[str, Any]:
    """The values that differ from the reference (the defaults, if none), by key."""
    reference = reference or RunParameters()
    return {
        key: value(parameters, key)
        for key in (*METHODS, *PARAMETERS)
        if value(parameters, key) != value(reference, key)
    }


def stage_values(parameters: RunParameters, stage: Stage) -> dict[str, Any]:
    """What the result of one stage depends on by itself: its method and its parameters."""
    single_view = "detection_boxes" if parameters.single_view == "none" else parameters.single_view
    group = {"single_view": single_view, "fusion": "fusion", "tracks": "fusion"}[stage]
    values: dict[str, Any] = {}
    if stage == "single_view":
        values["single_view"] = parameters.single_view
    if stage == "fusion":
        values["fusion_method"] = parameters.fusion_method
    for key, parameter in PARAMETERS.items():
        if parameter.group == group and parameter.stage == stage:
            values[key] = value(parameters, key)
    return values

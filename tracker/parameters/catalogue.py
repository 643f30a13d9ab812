"""The methods that can be chosen, and all parameters: what a run depends on, as one class.

Another package adds a method by an entry point that names a
:class:`~tracker.parameters.method.Method`, in its ``pyproject.toml``::

    [project.entry-points."multiview_phd.single_view"]
    my_tracker = "my_package.my_module:METHOD"

``multiview_phd.fusion`` for a method of stage 2 or ``multiview_phd.smoothing`` for one of
stage 3. Its own parameters, a subclass of
:class:`~tracker.parameters.definition.Params`, then have sliders and flags like all others.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast, get_args

from pydantic import create_model, model_validator
from pydantic.fields import FieldInfo

from tracker.parameters.definition import Params, Stage, Topic
from tracker.parameters.groups import (
    association_matrix,
    colour_phd,
    detections,
    fusion,
    jpda,
    pseudo_particle,
    smoothing,
)
from tracker.parameters.groups.foreground import ForegroundParams, PictureParams
from tracker.parameters.groups.fusion import FusionParams
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.parameters.method import Method, MethodKey

ENTRY_POINTS: dict[MethodKey, str] = {
    "single_view": "multiview_phd.single_view",
    "fusion_method": "multiview_phd.fusion",
    "smoothing_method": "multiview_phd.smoothing",
}
"""The group of entry points of each stage, by which other packages add methods."""

BUILT_IN: dict[MethodKey, tuple[Method, ...]] = {
    "single_view": (
        colour_phd.METHOD,
        detections.BY_SHAPE,
        jpda.METHOD,
        pseudo_particle.METHOD,
        association_matrix.METHOD,
        detections.DETECTED,
        detections.FILTERED,
        detections.AS_THEY_ARE,
    ),
    "fusion_method": (fusion.SEQUENTIAL_PHD, fusion.MULTI_BERNOULLI),
    "smoothing_method": (smoothing.NONE, smoothing.POSITIONS, smoothing.IDENTITIES),
}
"""This project's methods of each stage, in the order in which they are listed."""

SHARED_GROUPS = ("pictures", "foreground", "fusion", "smoothing")
"""Groups of parameters that belong to no single method."""

RENAMED: Mapping[str, str] = {
    "fusion.recognition_doubt": "fusion.recognition_outlier_probability",
    "smoothing.doubt": "smoothing.ambiguity_threshold",
}
"""The keys of parameters in earlier versions, and their keys now: files, addresses and commands
that have the old ones are read as before."""

REMOVED: Mapping[str, str] = {
    "foreground.background_centre": "the c-means starts at a background centre of 5 grey levels",
    "foreground.foreground_centre": "the c-means starts at a foreground centre of 50 grey levels",
    "foreground.update_limit": "the adaptive background follows differences below 6 grey levels",
    "foreground.update_frames": "the adaptive background follows pixels after 10 steps",
    "foreground.update_rate": "the adaptive background goes a tenth of the way to each picture",
    "smoothing.reach": "further boxes of a track are sought for 1 s before and after it",
    "smoothing.gap": "a track is split where no camera detected it for more than 1 s",
    "smoothing.keeping": "the filter's label adds log odds of 2 to links over longer gaps",
    "fusion.posture_width": "a person in another posture is 0.6 half heights wide to each side",
    "fusion.posture_centre_sigma": "another posture's centre has a σ of 0.15 half heights",
    "fusion.posture_width_sigma": "another posture's half width has a σ of 0.5 half heights",
    "fusion.posture_height_sigma": "another posture's half height has a σ of 0.25 half heights",
    "fusion.posture_drop": "the height of another posture's centre has a σ of 0.3 half heights",
    "fusion.vertical_share": "σ_a along the vertical axis is a tenth of that along the floor",
    "fusion.start_velocity": "a new target's velocity has a σ of 0.7 m/s along each axis",
    "fusion.memory_gate_probability": "a lost track is recalled within a gate of 0.9",
    "fusion.recognition_swap": "evidence of who a track is fades with a time constant of 30 s",
    "fusion.recognition_own_odds": "a track gets a person's id from odds of its colours of 3",
    "fusion.gate_probability": "a person's own box lies in the gate by 0.9999",
    "smoothing.iterations": "boxes are associated and tracks fitted twice",
    "smoothing.memory": "boxes of a camera within 0.25 s count as one observation",
    "smoothing.rounds": "identities are resolved twice",
    "detection_phd.survival_probability": "a person in the picture is there a step later by 0.99",
    "detection_phd.pruning_threshold": "components lighter than 0.0001 are dropped",
    "detection_phd.gate_probability": "a person's own box lies in the gate by 0.9999",
    "detection_phd.detection_probability": "a person in the picture gets a box by 0.9",
    "detection_phd.clutter_rate": "one false box a step is expected in each camera",
    "detection_phd.score_clutter": "clutter falls with a box's score by exp(1 - 2 score)",
    "detection_phd.birth_rate": "one person a second is expected at a box without a target",
    "detection_phd.motion_sigma": "a person moves by 0.5 half heights in the square root of 1 s",
    "detection_phd.growth_sigma": "a box grows by 0.2 half sizes in the square root of 1 s",
    "detection_phd.merging_threshold": "components within a squared distance of 4 are merged",
    "detection_phd.max_components": "the 60 heaviest components are kept",
    "detection_phd.extraction_threshold": "components heavier than 0.5 are estimates",
    "colour_phd.extraction_threshold": "components heavier than 0.5 are estimates",
    "pseudo_particle.colour_space": "colour_phd.colour_space is read instead",
    "pseudo_particle.histogram_kernel": "colour_phd.histogram_kernel is read instead",
    "pseudo_particle.acceptance_foreground": "colour_phd.acceptance_foreground is read instead",
    "pseudo_particle.foreground_weight": "colour_phd.foreground_weight is read instead",
    "pseudo_particle.surroundings_weight": "colour_phd.surroundings_weight is read instead",
    "pseudo_particle.samples": "colour_phd.samples is read instead",
    "pseudo_particle.motion_sigma": "colour_phd.motion_sigma is read instead",
    "pseudo_particle.growth_sigma": "colour_phd.growth_sigma is read instead",
    "pseudo_particle.centre_sigma": "colour_phd.centre_sigma is read instead",
    "pseudo_particle.size_sigma": "colour_phd.size_sigma is read instead",
    "pseudo_particle.size_jitter": "colour_phd.size_jitter is read instead",
    "jpda.gate_volume": "the area of a gate follows from jpda.gate_probability",
    "detection_boxes.depth_sigmas": "a box's size may be wrong by three deviations",
    "detection_phd.depth_sigmas": "a box's size may be wrong by three deviations",
    "detection_phd.room_tolerance": "detection_boxes.room_tolerance is read instead",
    "detection_phd.centre_sigma": "detection_boxes.centre_sigma is read instead",
    "detection_phd.size_sigma": "detection_boxes.size_sigma is read instead",
    "detection_phd.width_sigma": "detection_boxes.width_sigma is read instead",
    "detection_phd.pixel_sigma": "detection_boxes.pixel_sigma is read instead",
    "onnx_detector.depth_sigmas": "a box's size may be wrong by three deviations",
    "onnx_detector.room_tolerance": "detection_boxes.room_tolerance is read instead",
    "onnx_detector.centre_sigma": "detection_boxes.centre_sigma is read instead",
    "onnx_detector.size_sigma": "detection_boxes.size_sigma is read instead",
    "onnx_detector.width_sigma": "detection_boxes.width_sigma is read instead",
    "onnx_detector.pixel_sigma": "detection_boxes.pixel_sigma is read instead",
    "detection_phd.score_threshold": "detection_boxes.score_threshold is read instead",
    "pseudo_particle.smallest_cluster": "clusters below a hundredth of the particles are dropped",
    "pseudo_particle.confirmation": "a new target is confirmed once it was detected at 3 steps",
    "pseudo_particle.memory": "a target of the same colours continues an id within 10 s",
    "pictures.target_height": "pictures are reduced until the median target is 160 pixels high",
    "pictures.least_height": "no picture is reduced until the median target is below 40 pixels",
    "foreground.blinding_share": "a picture that differs everywhere is segmented like any other",
    "pictures.level_from": "pictures of cameras that are rolled by more than 0.15 rad are turned",
    "association_matrix.interrupted_steps": "a track ends without an object for over 25 steps",
    "association_matrix.return_similarity": "an object continues a track from a similarity of 0.6",
    "association_matrix.mild_share": "mild: the merged object is above 0.8 of both",
    "association_matrix.occlusion_distance": "people join within 0.5 half widths",
    "association_matrix.histogram_rate": "each step's colours are a tenth of a track's",
    "association_matrix.straying": "an interrupted object strays by a tenth of its reach a step",
    "colour_phd.same_person_distance": "peaks of one person's colours are 1.5 half sizes apart",
    "colour_phd.max_components": "the 30 heaviest components are kept",
    "colour_phd.gate_probability": "a person's own peak lies in the gate by 0.9999",
    "jpda.vanish_steps": "a target without measurement at 3 steps in a row has vanished",
    "jpda.return_steps": "a new target continues one that vanished at most 5 steps ago",
    "jpda.longest_hidden": "a target that stays occluded for longer than 4 s is dropped",
    "shapes.cover": "an occluded person lies within 2 half sizes of the box that hides them",
}
"""The keys of parameters of earlier versions that no longer exist, and what holds instead: files,
addresses and commands that name them are read without them, and a note says so."""

DEFAULT_CANDIDATES = ("colour_phd", "none", "shapes")
"""Candidates for the default of ``single_view``: the first whose requirements the recording
meets is chosen, or a fetched detection network instead of shapes."""

DEFAULT_RULE = (
    "follows the recording: onnx_detector where a detector is named, else colour_phd with "
    "pictures and templates, else none with detections, else onnx_detector where one was fetched "
    "and standing people are 100 pixels high in every camera, else shapes"
)
"""The same rule as text for help messages."""


class PluginWarning(UserWarning):
    """The method of another package cannot be used; all other methods can."""


def _of_packages(group: str, names: set[str]) -> Iterator[tuple[Method, str]]:
    """Yield the methods of a group of entry points, each with its distribution and version.

    Args:
        group: The group of entry points.
        names: The names of methods and groups that are in use; those of the methods are added.
    """
    found = sorted(entry_points(group=group), key=lambda point: (point.name, point.value))
    for point in dict.fromkeys(found):
        try:
            method = point.load()
        except Exception as error:
            _warn(point, f"cannot be imported: {type(error).__name__}: {error}")
            continue
        if not isinstance(method, Method):
            _warn(point, f"expected a tracker.parameters.Method, found {type(method).__name__}")
        elif not method.name.isidentifier():
            _warn(point, f'a method\'s name is a word like my_tracker, found "{method.name}"')
        elif method.name in names:
            _warn(point, f'there is a method "{method.name}" already; give it another name')
        elif method.parameters is not None and method.own_group in names:
            _warn(point, f'there is a group of parameters "{method.own_group}" already')
        else:
            names |= {method.name, method.own_group}
            yield method, f"{point.dist.name} {point.dist.version}" if point.dist else point.value


def _warn(point: EntryPoint, words: str) -> None:
    package = f" of {point.dist.name} {point.dist.version}" if point.dist else ""
    warnings.warn(
        f'entry point {point.name} = "{point.value}" in {point.group}{package}: {words}. '
        "The method is left out.",
        PluginWarning,
        stacklevel=2,
    )


def _registered() -> tuple[dict[MethodKey, dict[str, Method]], dict[str, str]]:
    """Return the methods of each kind by name, and the packages of those of others."""
    methods: dict[MethodKey, dict[str, Method]] = {}
    origins: dict[str, str] = {}
    for key, built_in in BUILT_IN.items():
        methods[key] = {method.name: method for method in built_in}
    own = [method for of_stage in methods.values() for method in of_stage.values()]
    names = {*BUILT_IN, *SHARED_GROUPS, *(name for m in own for name in (m.name, m.own_group))}
    for key, group in ENTRY_POINTS.items():
        for method, origin in _of_packages(group, names):
            methods[key][method.name] = method
            origins[method.name] = origin
    return methods, origins


REGISTERED, ORIGINS = _registered()
"""All methods by the parameter that chooses them and by name; and the distribution and version of
each method of another package, by name."""

_Group = TypeVar("_Group", bound=Params)


class SharedParameters(Params):
    """Everything that a run depends on, besides the sequence and the seed."""

    single_view: str = "colour_phd"
    """Method of stage 1: boxes from each camera's pictures, or a detector's, filtered or not."""

    fusion_method: str = "multi_bernoulli"
    """Method of stage 2: how the cameras' boxes become 3D positions."""

    smoothing_method: str = "identities"
    """Method of stage 3: the filter's tracks as they are, smoothed, or with identities resolved."""

    pictures: PictureParams = PictureParams()
    foreground: ForegroundParams = ForegroundParams()
    fusion: FusionParams = FusionParams()
    smoothing: SmoothingParams = SmoothingParams()

    @model_validator(mode="before")
    @classmethod
    def _read_earlier_names(cls, data: Any) -> Any:
        """Move the values that have names of earlier versions to the names of now, and leave out
        those of parameters that no longer exist."""
        if not isinstance(data, dict):
            return data
        data = dict(data)
        for key in REMOVED:
            group, name = key.split(".")
            values = data.get(group)
            if isinstance(values, dict) and name in values:
                data[group] = {other: one for other, one in values.items() if other != name}
        for old, new in RENAMED.items():
            (group, before), name = old.split("."), new.split(".")[1]
            values = data.get(group)
            if isinstance(values, dict) and before in values:
                values = dict(values)
                values.setdefault(name, values.pop(before))
                data[group] = values
        return data

    def of(self, kind: type[_Group]) -> _Group:
        """Return the parameters of one group, by their class.

        Raises:
            KeyError: If no registered method has this class for its parameters.
        """
        for name, field in type(self).model_fields.items():
            if field.annotation is kind:
                return cast(_Group, getattr(self, name))
        raise KeyError(f"no registered method has {kind.__name__} for its parameters")

    def method(self, key: MethodKey) -> Method:
        """Return the description of the chosen method."""
        return REGISTERED[key][getattr(self, key)]


def _with_methods() -> type[SharedParameters]:
    """Make the class with a group for every method that has one, and the methods' names as
    choices."""
    fields: dict[str, Any] = {}
    for key, methods in REGISTERED.items():
        shared: FieldInfo = SharedParameters.model_fields[key]
        fields[key] = (Literal[tuple(methods)], shared)
        for method in methods.values():
            if method.parameters is not None:
                fields[method.own_group] = (method.parameters, method.parameters())
    return create_model(
        "RunParameters",
        __base__=SharedParameters,
        __module__=__name__,
        __doc__=SharedParameters.__doc__,
        **fields,
    )


if TYPE_CHECKING:

    class RunParameters(SharedParameters):
        """Everything that a run depends on, besides the sequence and the seed."""

else:
    RunParameters = _with_methods()


Kind = Literal["float", "int", "bool", "choice"]
"""The type of a parameter's value."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter with all that its slider, flag, schema and page of the manual show."""

    key: str
    """``group.name``, for instance ``fusion.survival_probability``."""
    group: str
    """The group of the key."""
    name: str
    """The name within the group."""
    label: str
    """The name in words."""
    help: str
    """The meaning in one sentence."""
    symbol: str
    """The symbol in equations."""
    unit: str
    """The unit of the value; empty for numbers without unit, and for choices."""
    stage: Stage
    """The first stage that is computed again after a change."""
    topic: Topic
    """What the parameter is about."""
    kind: Kind
    """The type of the value."""
    default: Any
    """The default value."""
    minimum: float | None
    """The least value, included; None for a switch or a choice."""
    maximum: float | None
    """The largest value, included; None for a switch or a choice."""
    step: float | None
    """The step of the slider, in the unit of the value; None where it has none of its own."""
    log: bool
    """Whether the slider is logarithmic."""
    choices: tuple[str, ...]
    """The possible values of a choice; empty for other kinds."""
    published: Any
    """The value in the ``published`` preset; None where it is the default."""
    advanced: bool
    """Whether the page folds the parameter away at first."""
    when: Mapping[str, tuple[Any, ...]]
    """Keys of other parameters, and the values of each with which this one has an effect."""
    essential: bool
    """Whether the parameter is among the few that the page shows first."""
    slider: tuple[float, float, float] | None
    """The least value, the largest and the step of the linear slider of an essential parameter;
    None for the others."""

    def slider_range(self, value: float) -> tuple[float, float]:
        """Return the ends of every slider of an essential parameter while it has a value: those of
        :attr:`slider`, and further out where the value is."""
        assert self.slider is not None
        low, high, _ = self.slider
        return min(low, value), max(high, value)


def _group_stage(group: str) -> Stage:
    fused = (method.own_group for method in REGISTERED["fusion_method"].values())
    smoothed = (method.own_group for method in REGISTERED["smoothing_method"].values())
    if group == "smoothing" or group in smoothed:
        return "smoothing"
    return "fusion" if group == "fusion" or group in fused else "single_view"


def _slider(bounds: Mapping[str, Any], extra: Mapping[str, Any]) -> Any:
    """Return the linear slider over the whole range of an essential parameter, else None."""
    return (bounds["ge"], bounds["le"], extra["step"]) if extra["essential"] else None


def _describe(group: str, model: type[Params], name: str, field: FieldInfo) -> Parameter:
    """Return the parameter that a field of a group defines."""
    assert isinstance(field.json_schema_extra, dict)
    extra: Any = field.json_schema_extra["x-ui"]
    bounds: dict[str, Any] = {}
    for item in field.metadata:
        bounds.update({k: getattr(item, k) for k in ("ge", "le") if hasattr(item, k)})
    annotation = field.annotation
    kinds: dict[Any, Kind] = {float: "float", int: "int", bool: "bool"}
    return Parameter(
        key=f"{group}.{name}",
        group=group,
        name=name,
        label=name.replace("_", " ").capitalize(),
        help=" ".join((field.description or "").split()),
        symbol=extra["symbol"],
        unit=extra["unit"],
        stage=extra["stage"] or _group_stage(group),
        topic=extra["topic"] or model.topic,
        kind=kinds.get(annotation, "choice"),
        default=field.default,
        minimum=bounds.get("ge"),
        maximum=bounds.get("le"),
        step=extra["step"],
        log=extra["log"],
        choices=() if annotation in kinds else tuple(get_args(annotation)),
        published=extra["published"],
        advanced=extra["advanced"],
        when={f"{group}.{other}": tuple(values) for other, values in extra["when"].items()},
        essential=extra["essential"],
        slider=extra["slider"] or _slider(bounds, extra),
    )


def _groups() -> dict[str, type[Params]]:
    """Return the class of each group: those of the methods in their order, then the shared."""
    found = {
        name: field.annotation
        for name, field in RunParameters.model_fields.items()
        if isinstance(field.annotation, type) and issubclass(field.annotation, Params)
    }
    return {name: found[name] for name in sorted(found, key=lambda name: name in SHARED_GROUPS)}


def _collect() -> Iterator[Parameter]:
    for group, model in _groups().items():
        for name, field in model.model_fields.items():
            yield _describe(group, model, name, field)


PARAMETERS: dict[str, Parameter] = {p.key: p for p in _collect()}
"""Every parameter by its key, in the order of definition."""

GROUPS: dict[str, str] = {name: (model.__doc__ or "").strip() for name, model in _groups().items()}
"""Every group of parameters and what it is for."""

METHODS: dict[MethodKey, tuple[str, ...]] = {
    key: tuple(methods) for key, methods in REGISTERED.items()
}
"""The methods that can be chosen for stages 1, 2 and 3."""

PRESETS: dict[str, dict[str, Any]] = {
    "robust": {},
    "published": {
        **{key: p.published for key, p in PARAMETERS.items() if p.published is not None},
        "fusion_method": "sequential_phd",
        "smoothing_method": "none",
    },
}
"""Named sets of values, each against the defaults: ``robust`` is the defaults themselves."""


def method_of(key: MethodKey, name: str) -> Method:
    """Return the description of a registered method.

    Args:
        key: The parameter that chooses the method.
        name: The method's name.

    Raises:
        ValueError: If there is no such method.
    """
    if name not in REGISTERED[key]:
        raise ValueError(f"{key}: expected one of {', '.join(REGISTERED[key])}, got {name!r}")
    return REGISTERED[key][name]

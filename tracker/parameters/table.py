"""The table of all parameters, made from their definitions, and the presets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from pydantic.fields import FieldInfo

from tracker.parameters.definition import Params, Stage
from tracker.parameters.methods import Method, MethodKey
from tracker.parameters.registry import REGISTERED, SHARED_GROUPS
from tracker.parameters.run import RunParameters


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
    kind: Literal["float", "int", "bool", "choice"]
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


def _group_stage(group: str) -> Stage:
    fused = (method.own_group for method in REGISTERED["fusion_method"].values())
    smoothed = (method.own_group for method in REGISTERED["smoothing_method"].values())
    if group == "smoothing" or group in smoothed:
        return "smoothing"
    return "fusion" if group == "fusion" or group in fused else "single_view"


def _describe(group: str, name: str, field: FieldInfo) -> Parameter:
    """Return the parameter that a field of a group defines."""
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
        help=" ".join((field.description or "").split()),
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
        when={f"{group}.{other}": tuple(values) for other, values in extra["when"].items()},
        essential=extra["essential"],
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
            yield _describe(group, name, field)


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

"""The definition of a parameter: the validated group it belongs to, and how it is presented."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

Stage = Literal["single_view", "fusion", "smoothing", "tracks"]
"""The stages of a run: boxes in each camera, 3D posterior, smoothed tracks, reported tracks."""

Topic = Literal["Motion", "Birth", "Detection", "Clutter", "Foreground", "Extraction"]
"""What a parameter is about, in the order of a filter's step: a folder of the page's panel."""

NO_CONDITION: Mapping[str, tuple[Any, ...]] = MappingProxyType({})
"""The condition of a parameter that has an effect with any values of the others."""


def ui(
    symbol: str,
    topic: Topic | None = None,
    *,
    unit: str = "",
    step: float | None = None,
    log: bool = False,
    stage: Stage | None = None,
    published: Any = None,
    advanced: bool = False,
    when: Mapping[str, tuple[Any, ...]] = NO_CONDITION,
    essential: bool = False,
    slider: tuple[float, float, float] | None = None,
) -> Any:
    """Return a pydantic field with the presentation of a parameter, beyond range and help.

    Args:
        symbol: The symbol in formulas, for instance ``p_S``.
        topic: What the parameter is about; None for the topic of its group.
        unit: The unit of the value; empty for numbers without unit.
        step: The step of the slider, in the parameter's unit.
        log: Whether the slider is logarithmic; the range must be positive.
        stage: The first stage that is computed again after a change; None for the group's stage.
        published: The value in the ``published`` preset, where it differs from the default.
        advanced: Whether the page folds the parameter away at first.
        when: Other parameters of the same group and the values of each with which this one has
            an effect; with any other value it is not shown.
        essential: Whether the parameter is among the few that the page shows first.
        slider: The least value, the largest and the step of the linear slider beside the 3D view,
            where the range is logarithmic; the published value and the default lie within.
    """
    extra = {
        "symbol": symbol,
        "topic": topic,
        "unit": unit,
        "step": step,
        "log": log,
        "stage": stage,
        "published": published,
        "advanced": advanced,
        "when": {name: list(values) for name, values in when.items()},
        "essential": essential,
        "slider": slider,
    }
    return Field(json_schema_extra={"x-ui": extra})


class Params(BaseModel):
    """A group of parameters. Values are validated, and an instance is never changed."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        validate_default=True,
    )

    topic: ClassVar[Topic] = "Detection"
    """What those parameters of the group are about that name no topic of their own."""

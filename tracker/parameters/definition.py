"""What a parameter's definition is made of: a checked group, and how each number is presented."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Stage = Literal["single_view", "fusion", "smoothing", "tracks"]

NO_CONDITION: Mapping[str, tuple[Any, ...]] = MappingProxyType({})


def ui(
    symbol: str,
    *,
    unit: str = "",
    step: float | None = None,
    log: bool = False,
    stage: Stage | None = None,
    published: Any = None,
    advanced: bool = False,
    when: Mapping[str, tuple[Any, ...]] = NO_CONDITION,
    essential: bool = False,
) -> Any:
    """How a parameter is presented, beyond its range and help.

    Args:
        symbol: As the formulas write it, for instance ``p_S``.
        unit: Empty for plain numbers.
        step: Of the slider.
        log: Whether the slider is logarithmic; the range must be positive.
        stage: The first stage that a change re-runs, where it is not the group's.
        published: The value of the ``published`` preset, where it differs from the default.
        advanced: Whether the page folds it away at first.
        when: Other parameters of the same group and the values of each with which this one has
            an effect; with any other value it is not shown.
        essential: Whether it is among the few that the page shows first.
    """
    extra = {
        "symbol": symbol,
        "unit": unit,
        "step": step,
        "log": log,
        "stage": stage,
        "published": published,
        "advanced": advanced,
        "when": {name: list(values) for name, values in when.items()},
        "essential": essential,
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

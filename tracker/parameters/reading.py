"""The parameters that have an effect with the chosen methods: for cache keys, and for display."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from tracker.parameters.changing import value
from tracker.parameters.definition import Stage
from tracker.parameters.methods import MethodKey, Uses
from tracker.parameters.run import RunParameters
from tracker.parameters.table import METHODS, PARAMETERS

CHOSEN_BY: dict[Stage, MethodKey] = {
    "single_view": "single_view",
    "fusion": "fusion_method",
    "smoothing": "smoothing_method",
    "tracks": "fusion_method",
}
"""The parameter that chooses the method which reads a stage's parameters."""


def stage_values(parameters: RunParameters, stage: Stage) -> dict[str, Any]:
    """Return the values that one stage's result depends on: its method and its parameters.

    A parameter that has no effect only because of another's value (``when``) is included all the
    same: a cached result must never be mistaken for that of other parameters.
    """
    values: dict[str, Any] = {}
    for method in METHODS:
        if stage == method.removesuffix("_method"):
            values[method] = value(parameters, method)
    used = parameters.method(CHOSEN_BY[stage]).used(parameters)
    return values | {key: value(parameters, key) for key in _keys_read(used, stage)}


@lru_cache(maxsize=256)
def _keys_read(used: Uses, stage: Stage) -> tuple[str, ...]:
    """Return the keys of a stage's parameters that a method reads."""
    return tuple(
        key
        for key, parameter in PARAMETERS.items()
        if parameter.stage == stage and used.reads_parameter(parameter.group, parameter.name)
    )


def shown_keys(parameters: RunParameters) -> list[str]:
    """Return the keys of the method choices and of all parameters that now have an effect."""
    read = set[str]()
    for stage, method in CHOSEN_BY.items():
        read |= set(_keys_read(parameters.method(method).used(parameters), stage))
    return [*METHODS] + [
        key
        for key, parameter in PARAMETERS.items()
        if key in read
        and all(value(parameters, other) in values for other, values in parameter.when.items())
    ]

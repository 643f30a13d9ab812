"""Which parameters count with the chosen methods and values: for results, and for people."""

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
"""The parameter that chooses the method which a stage's numbers are for."""


def stage_values(parameters: RunParameters, stage: Stage) -> dict[str, Any]:
    """What the result of one stage depends on by itself: its method and its parameters.

    A number that has no effect with some value of another counts all the same: what is kept
    of a run must never be taken for another's.
    """
    values: dict[str, Any] = {}
    for method in METHODS:
        if stage == method.removesuffix("_method"):
            values[method] = value(parameters, method)
    used = parameters.method(CHOSEN_BY[stage]).used(parameters)
    return values | {key: value(parameters, key) for key in _keys_read(used, stage)}


@lru_cache(maxsize=256)
def _keys_read(used: Uses, stage: Stage) -> tuple[str, ...]:
    """The numbers of a stage that a method reads."""
    return tuple(
        key
        for key, parameter in PARAMETERS.items()
        if parameter.stage == stage and used.reads_number(parameter.group, parameter.name)
    )


def shown_keys(parameters: RunParameters) -> list[str]:
    """The choices of the methods, and the numbers that have an effect with what is chosen."""
    read = set[str]()
    for stage, method in CHOSEN_BY.items():
        read |= set(_keys_read(parameters.method(method).used(parameters), stage))
    return [*METHODS] + [
        key
        for key, parameter in PARAMETERS.items()
        if key in read
        and all(value(parameters, other) in values for other, values in parameter.when.items())
    ]

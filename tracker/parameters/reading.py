"""Which parameters count with the chosen methods and values: for results, and for people."""

from __future__ import annotations

from typing import Any

from tracker.parameters.changing import value
from tracker.parameters.definition import Stage
from tracker.parameters.methods import MethodKey
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
    for key, parameter in PARAMETERS.items():
        if parameter.stage == stage and used.reads_number(parameter.group, parameter.name):
            values[key] = value(parameters, key)
    return values


def shown_keys(parameters: RunParameters) -> list[str]:
    """The choices of the methods, and the numbers that have an effect with what is chosen."""
    used = {stage: parameters.method(key).used(parameters) for stage, key in CHOSEN_BY.items()}
    shown: list[str] = list(METHODS)
    for key, parameter in PARAMETERS.items():
        if used[parameter.stage].reads_number(parameter.group, parameter.name) and all(
            value(parameters, other) in values for other, values in parameter.when.items()
        ):
            shown.append(key)
    return shown

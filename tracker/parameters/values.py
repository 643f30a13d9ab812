"""Values of parameters by key: they are read, changed with validation, compared and selected."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from operator import attrgetter
from typing import Any, cast

from pydantic import ValidationError

from tracker.files.text import visible
from tracker.parameters.catalogue import METHODS, PARAMETERS, REMOVED, RENAMED, RunParameters
from tracker.parameters.definition import Stage
from tracker.parameters.method import MethodKey, Uses

CHOSEN_BY: dict[Stage, MethodKey] = {
    "single_view": "single_view",
    "fusion": "fusion_method",
    "smoothing": "smoothing_method",
    "tracks": "fusion_method",
}
"""The parameter that chooses the method which reads a stage's parameters."""

_READ = {key: attrgetter(key) for key in (*METHODS, *PARAMETERS)}
"""The getter of each key, made once: the panel of sliders reads all values often."""


class ParameterError(ValueError):
    """A parameter does not exist or its value is out of range; the message says what to do.

    Args:
        key: The key of the parameter, or the given name if there is no such parameter.
        message: What was expected and what was found.
        hint: The list that has the possible names, if it is not the table of parameters.
    """

    def __init__(self, key: str, message: str, hint: str | None = None) -> None:
        super().__init__(f"{key}: {message}")
        self.key = key
        self.message = message
        self.hint = hint


def current_key(key: str) -> str:
    """Return the key that a parameter has now, for a key of this or an earlier version."""
    return RENAMED.get(key, key)


def with_current_keys(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by the keys of now, without those of parameters that no longer exist.

    A value under a key of now wins over one under its old.
    """
    renamed = {new: values[old] for old, new in RENAMED.items() if old in values}
    earlier = RENAMED.keys() | REMOVED.keys()
    return renamed | {key: one for key, one in values.items() if key not in earlier}


def removed_notes(keys: Iterable[str]) -> tuple[str, ...]:
    """Return one sentence for each key of a parameter that no longer exists: what holds instead."""
    return tuple(f"{key} no longer exists: {REMOVED[key]}" for key in keys if key in REMOVED)


def label_of(key: str) -> str:
    """Return what a parameter, or the choice of a method, is called in words."""
    known = PARAMETERS.get(key)
    return known.label if known is not None else key.replace("_", " ").capitalize()


def value_of(parameters: RunParameters, key: str) -> Any:
    """Return the value of one parameter (``group.name``), or the chosen method of a stage."""
    return _READ[current_key(key)](parameters)


def with_values(parameters: RunParameters, changes: Mapping[str, Any]) -> RunParameters:
    """Return the parameters with some values changed, after validation.

    Args:
        parameters: The parameters to start from; they are not modified.
        changes: The new values by key, also by the keys of earlier versions, of which those that
            no longer exist change nothing; numbers may be text, as on a command line.

    Raises:
        ParameterError: If a key does not exist or a value is out of its range.
    """
    data = parameters.model_dump()
    changes = with_current_keys(changes)
    for key, new in changes.items():
        if key in METHODS:
            data[key] = new
        elif key in PARAMETERS:
            group, name = key.split(".", 1)
            # pydantic takes True for 1, which nobody who names a number means
            is_switch = PARAMETERS[key].kind == "bool"
            data[group][name] = new if is_switch or not isinstance(new, bool) else str(new)
        else:
            raise ParameterError(visible(key[:100]), _unknown(key))
    try:
        return RunParameters.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise ParameterError(key, _sentence(key, first["type"], changes[key])) from None


def _sentence(key: str, problem: str, new: Any) -> str:
    """Say what the value of a key must be, and what it was.

    Args:
        key: The key of a parameter, or of the choice of a method.
        problem: The type of the error that pydantic found.
        new: The value.
    """
    parameter = PARAMETERS.get(key)
    if parameter is None or parameter.kind == "choice":
        choices = parameter.choices if parameter else METHODS[cast(MethodKey, key)]
        return f"expected one of {', '.join(choices)}, got {_shown(new)}"
    if parameter.kind == "bool":
        return f"expected true or false, got {_shown(new)}"
    if problem.startswith("int_"):
        return f"expected a whole number, got {_shown(new)}"
    if problem.startswith("float_") and (isinstance(new, bool) or not isinstance(new, int)):
        return f"expected a number, got {_shown(new)}"
    unit = f" {parameter.unit}" if parameter.unit else ""
    return (
        f"must be between {parameter.minimum:g} and {parameter.maximum:g}{unit}, "
        f"got {new if isinstance(new, str) and len(new) < 30 else _shown(new)}"
    )


def _shown(value: Any) -> str:
    """Format a rejected value for a message: its ``repr``, at most 60 characters."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write integers of thousands of digits
        return "a number with thousands of digits"
    return visible(text if len(text) <= 60 else f"{text[:57]}…")


def _unknown(key: str) -> str:
    near = difflib.get_close_matches(key[:100], [*PARAMETERS, *METHODS], n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"there is no such parameter; {hint}`multiview-phd parameters` lists them all"


def changed_values(
    parameters: RunParameters, reference: RunParameters | None = None
) -> dict[str, Any]:
    """Return the values that differ from those of a reference, by key.

    Args:
        parameters: The parameters whose values are returned.
        reference: The parameters to compare with; the defaults if None.
    """
    reference = reference or RunParameters()
    values = ((key, read(parameters), read(reference)) for key, read in _READ.items())
    return {key: own for key, own, other in values if own != other}


def stage_values(parameters: RunParameters, stage: Stage) -> dict[str, Any]:
    """Return the values that one stage's result depends on: its method and its parameters.

    A parameter that has no effect only because of another's value (``when``) is included all the
    same: a cached result must never be mistaken for that of other parameters.

    Args:
        parameters: The parameters of a run.
        stage: The stage.

    Returns:
        The values by key, the choice of the method first.
    """
    values: dict[str, Any] = {}
    for method in METHODS:
        if stage == method.removesuffix("_method"):
            values[method] = value_of(parameters, method)
    used = parameters.method(CHOSEN_BY[stage]).used(parameters)
    return values | {key: value_of(parameters, key) for key in _keys_read(used, stage)}


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
        and all(value_of(parameters, other) in values for other, values in parameter.when.items())
    ]

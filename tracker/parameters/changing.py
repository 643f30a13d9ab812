"""Values of parameters by key: they are read, changed with validation, and compared."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

from tracker.files.text import visible
from tracker.parameters.run import RunParameters
from tracker.parameters.table import METHODS, PARAMETERS, Parameter

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
        self.hint = hint


def value(parameters: RunParameters, key: str) -> Any:
    """Return the value of one parameter (``group.name``), or the chosen method of a stage."""
    return _READ[key](parameters)


def with_values(parameters: RunParameters, changes: Mapping[str, Any]) -> RunParameters:
    """Return the parameters with some values changed, after validation.

    Args:
        parameters: The parameters to start from; they are not modified.
        changes: The new values by key; numbers may be text, as on a command line.

    Raises:
        ParameterError: If a key does not exist or a value is out of its range.
    """
    data = parameters.model_dump()
    for key, new in changes.items():
        if key in METHODS:
            if not isinstance(new, str) or new not in METHODS[key]:
                raise ParameterError(
                    key, f"expected one of {', '.join(METHODS[key])}, got {_shown(new)}"
                )
            data[key] = new
        elif key in PARAMETERS:
            group, name = key.split(".", 1)
            data[group][name] = _checked(PARAMETERS[key], new)
        else:
            raise ParameterError(visible(key[:100]), _unknown(key))
    return RunParameters.model_validate(data)


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


def _checked(parameter: Parameter, new: Any) -> Any:
    """Return a value in the type of its parameter, or raise an error if it is not valid."""
    if parameter.kind == "choice":
        if not isinstance(new, str) or new not in parameter.choices:
            choices = ", ".join(parameter.choices)
            raise ParameterError(parameter.key, f"expected one of {choices}, got {_shown(new)}")
        return new
    if parameter.kind == "bool":
        words = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}
        known = words.get(str(new).lower())
        if known is None:
            raise ParameterError(parameter.key, f"expected true or false, got {_shown(new)}")
        return known
    try:
        if isinstance(new, bool):
            raise TypeError
        number = float(new)
    except (TypeError, ValueError):
        raise ParameterError(parameter.key, f"expected a number, got {_shown(new)}") from None
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf if new > 0 else -math.inf
    if parameter.kind == "int":
        if number != int(number) if abs(number) < 1e18 else True:
            raise ParameterError(parameter.key, f"expected a whole number, got {_shown(new)}")
        number = int(number)
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    if not parameter.minimum <= number <= parameter.maximum:
        unit = f" {parameter.unit}" if parameter.unit else ""
        raise ParameterError(
            parameter.key,
            f"must be between {parameter.minimum:g} and {parameter.maximum:g}{unit}, "
            f"got {new if isinstance(new, str) and len(new) < 30 else _shown(new)}",
        )
    return number


def changed(parameters: RunParameters, reference: RunParameters | None = None) -> dict[str, Any]:
    """Return the values that differ from those of a reference, by key.

    Args:
        parameters: The parameters whose values are returned.
        reference: The parameters to compare with; the defaults if None.
    """
    reference = reference or RunParameters()
    values = ((key, read(parameters), read(reference)) for key, read in _READ.items())
    return {key: own for key, own, other in values if own != other}

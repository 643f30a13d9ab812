"""The search space: a trial's parameters, of which those with an effect are drawn."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from tracker.parameters.catalogue import METHODS, PARAMETERS, Parameter, RunParameters
from tracker.parameters.values import shown_keys, value_of, with_values

GRID_STEPS = 5
"""The default number of a parameter's values on a grid."""


@dataclass(frozen=True, slots=True)
class Varied:
    """A parameter, or the choice of a method, that a study varies."""

    key: str
    """The key of the parameter."""
    low: float | None = None
    """Smallest value in the parameter's unit; None if there are choices."""
    high: float | None = None
    """Largest value in the parameter's unit, included; None if there are choices."""
    log: bool = False
    """Whether the logarithm of the value is drawn uniformly, rather than the value."""
    steps: int = GRID_STEPS
    """The number of values on a grid."""
    choices: tuple[Any, ...] = ()
    """The values of a parameter that is not varied over a range."""

    @property
    def is_whole(self) -> bool:
        """Whether the parameter is an integer."""
        return self.key in PARAMETERS and PARAMETERS[self.key].kind == "int"

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest value of a parameter that has no choices."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def nearest(self, tried: Any) -> Any:
        """Return the value of the range that is nearest to a value; of choices, the value itself,
        or the first choice if it is none of them."""
        if self.choices:
            return tried if tried in self.choices else self.choices[0]
        low, high = self.limits
        near = min(max(tried, low), high)
        return int(near) if self.is_whole else near

    def table(self) -> dict[str, Any]:
        """Return the parameter's table in a study's file."""
        if self.choices:
            return {"choices": list(self.choices)}
        return {"low": self.low, "high": self.high, "log": self.log, "steps": self.steps}


Draw = Callable[[Varied], Any]
"""A function that draws a value of one varied parameter."""

FACTOR = 4.0
"""Ratio of the largest value of a range around a value to this value, and of this value to the
smallest one, for a logarithmic parameter."""

SHARE = 0.25
"""Distance of either end of a range around a value from this value, as a share of the parameter's
whole range, for a parameter that is not logarithmic."""


def drawn(varied: Sequence[Varied], bases: Sequence[RunParameters], draw: Draw) -> dict[str, Any]:
    """Draw values of the parameters that have an effect given the values drawn before.

    Args:
        varied: The varied parameters.
        bases: The parameters on each recording; a varied parameter is drawn if it has an effect on
            at least one recording.
        draw: A function that draws a value. It is called for methods first, and for a parameter
            before those whose effect depends on it.

    Returns:
        The values by key.
    """
    values: dict[str, Any] = {}
    now = list(bases)
    deciding = set(METHODS) | {key for one in varied for key in _conditions(one)}
    shown = _shown(now)
    for one in ordered(varied):
        if one.key not in shown:
            continue
        values[one.key] = draw(one)
        if one.key in deciding:
            now = [with_values(base, values) for base in bases]
            shown = _shown(now)
    return values


def ordered(varied: Sequence[Varied]) -> list[Varied]:
    """Sort parameters: methods first, and each parameter after those on which its effect
    depends."""
    left, done = sorted(varied, key=lambda one: one.key not in METHODS), []
    while left:
        keys = {one.key for one in left}
        ready = [one for one in left if not keys & set(_conditions(one)) - {one.key}]
        done += ready or left
        left = [one for one in left if one not in done]
    return done


def _conditions(one: Varied) -> Sequence[str]:
    """Return the keys of the parameters on which the effect of a parameter depends."""
    return tuple(PARAMETERS[one.key].when) if one.key in PARAMETERS else ()


def _shown(bases: Sequence[RunParameters]) -> set[str]:
    """Return the keys of the parameters that have an effect on at least one recording."""
    return {key for base in bases for key in shown_keys(base)}


def grid(varied: Sequence[Varied], bases: Sequence[RunParameters]) -> Iterator[dict[str, Any]]:
    """Yield the combinations of a grid, one of those that differ only in values without effect.

    Args:
        varied: The varied parameters.
        bases: The parameters on each recording.
    """
    order = ordered(varied)
    seen: set[tuple[tuple[str, Any], ...]] = set()
    for combination in itertools.product(*(points(one) for one in order)):
        chosen = dict(zip((one.key for one in order), combination, strict=True))
        values = drawn(varied, bases, lambda one, chosen=chosen: chosen[one.key])  # type: ignore[misc]
        key = tuple(sorted(values.items(), key=lambda pair: pair[0]))
        if key not in seen:
            seen.add(key)
            yield values


def points(one: Varied) -> list[Any]:
    """Return the values of one parameter on a grid."""
    if one.choices:
        return list(one.choices)
    assert one.low is not None
    assert one.high is not None
    shares = [index / (one.steps - 1) for index in range(one.steps)]
    if one.log:
        found = [one.low * (one.high / one.low) ** share for share in shares]
    else:
        found = [one.low + share * (one.high - one.low) for share in shares]
    found = [min(max(each, one.low), one.high) for each in found]
    if one.is_whole:
        return sorted({round(each) for each in found})
    return found


def around(key: str, *values: Any) -> Varied:
    """Return a range around one or more values, within the parameter's definition.

    Args:
        key: The key of a parameter, or of the choice of a method.
        values: The values, for instance the current one and the default.
    """
    if key in METHODS:
        return Varied(key, choices=METHODS[key])
    parameter = PARAMETERS[key]
    if parameter.kind == "bool":
        return Varied(key, choices=(False, True))
    if parameter.kind == "choice":
        return Varied(key, choices=parameter.choices)
    ranges = [_around(parameter, float(one)) for one in values]
    low, high = min(one for one, _ in ranges), max(one for _, one in ranges)
    if parameter.kind == "int":
        low, high = math.floor(low), math.ceil(high)
    return Varied(key, low, high, parameter.log and low > 0.0)


def _around(parameter: Parameter, now: float) -> tuple[float, float]:
    """Return the smallest and the largest value of a range around a value."""
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    if parameter.log:
        low, high = now / FACTOR, now * FACTOR
    else:
        reach = SHARE * (parameter.maximum - parameter.minimum)
        low, high = now - reach, now + reach
    return max(low, parameter.minimum), min(high, parameter.maximum)


def defaults_of(varied: Sequence[Varied], base: RunParameters) -> dict[str, Any]:
    """Return the values that the varied parameters have in ``base``, by key."""
    return {one.key: value_of(base, one.key) for one in varied}

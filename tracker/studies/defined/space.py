"""The values of a trial: drawn where they have an effect, at their defaults elsewhere."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from tracker.parameters import (
    METHODS,
    PARAMETERS,
    Parameter,
    RunParameters,
    shown_keys,
    value,
    with_values,
)
from tracker.studies.defined.definition import Varied

Draw = Callable[[Varied], Any]
"""Gives a value of one varied parameter."""

FACTOR = 4.0
SHARE = 0.25
"""How far around a value a range reaches: by a factor over logarithms, else by a share of the
definition's range on either side."""


def drawn(varied: Sequence[Varied], bases: Sequence[RunParameters], draw: Draw) -> dict[str, Any]:
    """Values for what has an effect with the methods and values drawn before.

    Args:
        varied: What is varied.
        bases: Of each recording what is not varied; a parameter counts where it has an effect
            with one of them.
        draw: Called for each that counts: methods first, then others before those that have an
            effect only with some of their values.

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
    """Each behind those that it depends on: methods, then conditions."""
    left, done = sorted(varied, key=lambda one: one.key not in METHODS), []
    while left:
        keys = {one.key for one in left}
        ready = [one for one in left if not keys & set(_conditions(one)) - {one.key}]
        done += ready or left
        left = [one for one in left if one not in done]
    return done


def _conditions(one: Varied) -> Sequence[str]:
    return tuple(PARAMETERS[one.key].when) if one.key in PARAMETERS else ()


def _shown(bases: Sequence[RunParameters]) -> set[str]:
    return {key for base in bases for key in shown_keys(base)}


def grid(varied: Sequence[Varied], bases: Sequence[RunParameters]) -> Iterator[dict[str, Any]]:
    """Every combination of a grid once, without those that differ only where it has no effect."""
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
    """The values of one parameter on a grid."""
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
    """A range around one or more values, within the parameter's definition.

    Args:
        key: Of a parameter or the choice of a method.
        values: For instance today's and the default.
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
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    if parameter.log:
        low, high = now / FACTOR, now * FACTOR
    else:
        reach = SHARE * (parameter.maximum - parameter.minimum)
        low, high = now - reach, now + reach
    return max(low, parameter.minimum), min(high, parameter.maximum)


def defaults_of(varied: Sequence[Varied], base: RunParameters) -> dict[str, Any]:
    """What the varied parameters are by default."""
    return {one.key: value(base, one.key) for one in varied}

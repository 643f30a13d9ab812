"""The numbers and choices of the command line; a wrong one is a sentence with its flag."""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Union, get_args, get_origin

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from tracker.parameters.values import ParameterError

_NUMBERS: dict[type, str] = {float: "a number", int: "a whole number"}


class WrongValue(Exception):
    """A text that is not the value that its flag expects; no ``ValueError``, which the parser would
    put into words of its own."""

    def __init__(self, expected: str, found: str, near: str = "") -> None:
        super().__init__(expected, found)
        self.expected, self.found, self.near = expected, found, near

    def of(self, arguments: Sequence[str]) -> ParameterError:
        """Return the error of the flag that the text was given to, or of the command where it
        stands alone."""
        at = next(
            (k for k, word in enumerate(arguments) if word.partition("=")[2] == self.found), None
        )
        if at is None and self.found in arguments:
            at = max(arguments.index(self.found) - 1, 0)
        flag = "" if at is None else arguments[at].partition("=")[0]
        name = flag if flag.startswith("-") else arguments[0]
        return ParameterError(name, f"expected {self.expected}, got {self.found!r}{self.near}")


def registry() -> ConstructorRegistry:
    """The rules by which texts of the command line become numbers and choices."""
    rules = ConstructorRegistry()
    rules.primitive_rule(_rule)
    return rules


def _rule(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    kind = _without_none(info.type)
    if kind in _NUMBERS:
        return _spec(kind.__name__.upper(), _number(kind), lambda value: type(value) is kind)
    if kind is str and info.type is not str:
        return _spec("STR", str, lambda value: isinstance(value, str))
    if get_origin(kind) is Literal:
        choices = {str(one): one for one in get_args(kind)}
        metavar = "{" + ",".join(choices) + "}"
        return _spec(metavar, _choice(choices), lambda value: value in choices.values())
    return None


def _without_none(kind: Any) -> Any:
    """Return ``T`` of ``T | None``, and any other type as it is."""
    if get_origin(kind) in (Union, types.UnionType):
        parts = [one for one in get_args(kind) if one is not type(None)]
        return parts[0] if len(parts) == 1 else kind
    return kind


def _spec(
    metavar: str, read: Callable[[str], Any], is_one: Callable[[Any], bool]
) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: read(words[0]),
        is_instance=lambda value: value is None or is_one(value),
        str_from_instance=lambda value: [str(value)],
    )


def _number(kind: type) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            return kind(text)
        except ValueError:
            raise WrongValue(_NUMBERS[kind], text) from None

    return read


def _choice(choices: Mapping[str, Any]) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        if text not in choices:
            from tracker.sequences.fields import did_you_mean  # brings NumPy

            near = did_you_mean(text, choices)
            raise WrongValue(f"one of {', '.join(choices)}", text, near)
        return choices[text]

    return read

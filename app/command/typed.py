"""The numbers and choices of the command line; a wrong one is a sentence with its flag."""

from __future__ import annotations

import functools
import math
import re
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from tyro.conf import arg
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from tracker.parameters.values import ParameterError

_NUMBERS: dict[type, str] = {float: "a number", int: "a whole number"}


class WrongValue(Exception):
    """A text that is not the value that its flag expects; no ``ValueError``, which the parser would
    put into words of its own."""

    def __init__(self, expected: str, found: str, near: str = "", shown: str = "") -> None:
        super().__init__(expected, found)
        self.expected, self.found, self.near = expected, found, near
        self.shown = shown or repr(found)

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
        return ParameterError(name, f"expected {self.expected}, got {self.shown}{self.near}")


def registry() -> ConstructorRegistry:
    """The rules by which texts of the command line become numbers, choices and models."""
    rules = ConstructorRegistry()
    rules.primitive_rule(_rule)
    rules.struct_rule(_model)
    return rules


def _model(info: StructTypeInfo) -> StructConstructorSpec | None:
    """The flags of a model whose fields all have defaults."""
    if not (isinstance(info.type, type) and issubclass(info.type, BaseModel)):
        return None
    flags = (StructFieldSpec(name, *flag_of(info.type, name)) for name in info.type.model_fields)
    return StructConstructorSpec(info.type, tuple(flags))


def flag_of(model: type[BaseModel], name: str, unset: str = "optional") -> tuple[Any, Any]:
    """Return the flag of a model's field, as a type, and its default: help and limits are the
    field's own.

    Args:
        model: All of its fields have defaults.
        name: The field: a number, a text, a choice, or a choice or a number.
        unset: What holds where the flag is not given and the field has no default but None.
    """
    field, schema = model.model_fields[name], _schema(model, name)
    default = f"{field.default:g}" if isinstance(field.default, float) else field.default
    hint = f"default: {default}" if default is not None else unset
    facts = ", ".join(one for one in (schema["x-ui"]["symbol"], _bounds(schema)) if one)
    words = " ".join(schema["description"].split()) + (facts and f" {facts}.")
    text = arg(help=words, help_behavior_hint=f"({hint})")
    return Annotated[field.annotation, reader_of(model, name), text], field.default


def reader_of(model: type[BaseModel], name: str) -> PrimitiveConstructorSpec[Any]:
    """Return what reads the text of a flag as the value of a model's field, within its limits."""
    kind, schema = model.model_fields[name].annotation, _schema(model, name)
    spec = _spec_of(kind) or _spec("|".join((*schema["enum"], "FLOAT")), str, bool)

    def read(words: Sequence[str]) -> Any:
        try:
            return getattr(model.model_validate({name: spec.instance_from_str([*words])}), name)
        except ValidationError as error:
            # "Input should be a valid number, unable to parse …", "String should have at most …"
            found = (one["msg"].split(", unable")[0] for one in error.errors())
            told = " or ".join(re.sub(r"^\w+ should (be|have) ", "", one) for one in found)
            raise WrongValue(_bounds(schema) or told, words[0]) from None

    return replace(spec, instance_from_str=read)


def limited(
    kind: type[int] | type[float], expected: str, least: float, most: float = math.inf
) -> PrimitiveConstructorSpec[Any]:
    """Return what reads the text of a flag as a number within limits, which ``expected`` names."""
    spec = _spec(kind.__name__.upper(), _number(kind), lambda value: type(value) is kind)

    def read(words: Sequence[str]) -> Any:
        number = spec.instance_from_str([*words])
        if not least <= number <= most:
            raise WrongValue(
                expected, words[0], shown=f"{number:g}" if kind is float else str(number)
            )
        return number

    return replace(spec, instance_from_str=read)


@functools.cache
def _properties(model: type[BaseModel]) -> dict[str, Any]:
    properties: dict[str, Any] = model.model_json_schema()["properties"]
    return properties


def _schema(model: type[BaseModel], name: str) -> dict[str, Any]:
    """What is said of a field, and of the first thing that it can be."""
    own: dict[str, Any] = _properties(model)[name]
    return {"x-ui": {"symbol": "", "unit": ""}, **own, **own.get("anyOf", [{}])[0]}


def _bounds(schema: Mapping[str, Any]) -> str:
    """What a number may be; empty where that is not said by a least value."""
    if "minimum" not in schema:
        return ""
    most = schema.get("maximum")
    above = "or more" if most is None else f"… {most:g}"
    return f"{schema['minimum']:g} {above} {schema['x-ui']['unit']}".rstrip()


def _rule(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    return None if info.type is str else _spec_of(info.type)


def _spec_of(kind: Any) -> PrimitiveConstructorSpec[Any] | None:
    kind = _without_none(kind)
    if get_origin(kind) is Annotated:  # with its limits
        kind = get_args(kind)[0]
    if kind in _NUMBERS:
        return _spec(kind.__name__.upper(), _number(kind), lambda value: type(value) is kind)
    if kind is str:
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
            number = kind(text)
            if not math.isfinite(number):
                raise ValueError
            return number
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

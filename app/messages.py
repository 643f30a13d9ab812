"""The base class of all messages: pixels, metres and steps; ``null`` is a missing value.

pydantic reads docstrings when a class is made, which for all messages together takes a tenth of
the program's start; here they are read when somebody asks for the description.
"""

from __future__ import annotations

import ast
import inspect
import os
import sys
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError


class Described(BaseModel):
    """A message that is described by what stands below its attributes."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Its schema with a description of every attribute that has none of its own."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for base in cls.__mro__:
            if issubclass(base, Described):
                for name, words in _docstrings(base).items():
                    if name in properties:
                        properties[name].setdefault("description", words)
        return schema


@cache
def _docstrings(cls: type) -> dict[str, str]:
    """What stands below each attribute of a class, by its name."""
    found = _classes(cls.__module__).get(cls.__qualname__)
    return {} if found is None else dict(_below(found.body))


def _below(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for one, following in pairwise(body):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
            words = following.value if isinstance(following, ast.Expr) else None
            if isinstance(words, ast.Constant) and isinstance(words.value, str):
                yield one.target.id, inspect.cleandoc(words.value)


@cache
def _classes(module: str) -> dict[str, ast.ClassDef]:
    """The classes of a module; none where its source is not at hand."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except OSError:
        return {}
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}


class Model(Described):
    """A message; attribute docstrings become the descriptions of the OpenAPI page."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_serialization_defaults_required=True,  # an answer has all of its fields
    )


M = TypeVar("M", bound=Model)


def filled(message: type[M], source: object, **own: Any) -> M:
    """A message with what its source has under the names of its fields, and what is given."""
    names = [name for name in message.model_fields if name not in own and hasattr(source, name)]
    return message(**{name: getattr(source, name) for name in names}, **own)


Box = tuple[float, float, float, float]
"""left, top, width, height in pixels."""

Vector = tuple[float, float, float]
"""x, y, z in metres, world frame."""


LONGEST_NAME = 255
"""Bytes of a file's name, on most systems."""

LONGEST_PATH = 3000
"""Bytes of a path that somebody gives, so that what is put before and behind it has room."""


def _checked(words: str) -> str:
    try:
        path = Path(words.strip()).expanduser()
        if "\0" in words:
            raise ValueError("it has a null character")
        if len(os.fsencode(path)) > LONGEST_PATH:
            raise ValueError(f"it has more than {LONGEST_PATH} bytes")
        if any(len(os.fsencode(part)) > LONGEST_NAME for part in path.parts):
            raise ValueError(f"one of its names has more than {LONGEST_NAME} bytes")
    except (ValueError, RuntimeError) as error:  # RuntimeError: ~ of nobody who is known here
        raise PydanticCustomError(
            "no_path",
            "expected a name or a path, got one that cannot be: {why}",
            {"why": str(error)},
        ) from None
    return words


GivenPath = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(_checked)]
"""A name or a path of this machine that a system can have."""

RowNumber = Annotated[int, Field(ge=1, lt=1 << 63)]
"""Of something in the library, which counts from 1 in 64 bits."""


class Marks(Described):
    """What a person says of a stored run; null leaves a mark as it is."""

    title: str | None = Field(default=None, max_length=200, serialization_alias="name")
    """The name of the run, which keeps it for ever; an empty one takes it away."""
    star: bool | None = None
    """Whether it has a star, which keeps it for ever."""
    note: str | None = Field(default=None, max_length=10_000)
    tags: list[str] | None = Field(default=None, max_length=50)


class VideoPart(Described):
    """Which steps of a run a video has, and how fast they are."""

    first: int = Field(default=0, ge=0)
    """The first step of a video."""
    last: int | None = Field(default=None, ge=0)
    """The last step of a video, included; without it the last one computed."""
    speed: float = Field(default=1.0, ge=0.01, le=100.0)
    """The speed of a video: 0.5 is half as fast as it was."""

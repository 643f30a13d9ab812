"""What messages are made of: pixels, metres and steps; ``null`` stands for what is not there."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from app.described import Described


class Model(Described):
    """A message; attribute docstrings become the descriptions of the OpenAPI page."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_serialization_defaults_required=True,  # an answer has all of its fields
    )


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

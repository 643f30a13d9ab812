"""What messages are made of: pixels, metres and steps; ``null`` stands for what is not there."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Model(BaseModel):
    """A message; attribute docstrings become the descriptions of the OpenAPI page."""

    model_config = ConfigDict(
        use_attribute_docstrings=True,
        extra="forbid",
        json_schema_serialization_defaults_required=True,  # an answer has all of its fields
    )


Box = tuple[float, float, float, float]
"""left, top, width, height in pixels."""

Vector = tuple[float, float, float]
"""x, y, z in metres, world frame."""

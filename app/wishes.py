"""What the command line and the API both take: each name, help and limit is said here, once."""

from __future__ import annotations

from pydantic import Field

from app.described import Described


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

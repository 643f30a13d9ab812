"""Corrections and doubtful places, as the page sends and gets them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.models.base import Model, Vector

Kind = Literal[
    "same", "different", "exchanged", "here", "nobody", "came", "left", "name", "checked"
]

Step = Annotated[int, Field(ge=0)]
Finite = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]


class Click(Model):
    """A place in a picture: where somebody's feet are, or, in two pictures, the same point."""

    camera: str = Field(max_length=200)
    """Its name."""
    x: Finite
    """Pixels."""
    y: Finite


class CorrectionWish(Model):
    """What somebody says; of whom is told by tracks of the shown run."""

    kind: Kind
    step: Step | None = None
    """Where; of most kinds the playhead's, where none is given."""
    to: Step | None = None
    """Of *exchanged*: from which step on they are themselves again."""
    tracks: list[int] = Field(default=[], max_length=2)
    """Ids of the shown run."""
    place: tuple[Finite, Finite, Finite] | None = None
    """Metres, world frame, the middle of the target: of *here*."""
    clicks: list[Click] = Field(default=[], max_length=2)
    """Of *here*, instead: the feet in one picture, or one point of the person in two."""
    accuracy: float | None = Field(default=None, ge=0.01, le=5.0)
    """Metres."""
    name: str | None = Field(default=None, min_length=1, max_length=80)
    first: Step | None = None
    """Of *checked*, and of *nobody* where it is not a whole life."""
    last: Step | None = None


class GhostsRequest(Model):
    """How it would be, to be shown in 3D; or that no more."""

    doubt: str | None = Field(default=None, max_length=40)
    """Of the queue; null: what is shown goes away."""
    alternative: int = Field(default=0, ge=0, le=20)
    """0: as it is."""


class CorrectionInfo(Model):
    """One correction."""

    id: str
    kind: Kind
    words: str
    note: str
    time: str
    first: int
    """Steps that it speaks of, both included."""
    last: int
    places: list[tuple[int, float, float, float]]
    """Step and world metres."""
    accuracy: float | None
    name: str | None
    met: bool | None
    """By the shown run; null while that is computed."""
    why: str
    """Where it is not met."""
    tracks: list[int]
    """Ids of whom it means in the shown run."""


class Corrections(Model):
    """All of the open recording, in their order."""

    run: str | None
    """Key of the run that they were held against."""
    file: str
    """Where they are kept."""
    problem: str | None
    """Why the file cannot be used: nothing is obeyed then."""
    corrections: list[CorrectionInfo]
    checked: list[tuple[int, int]]
    """Ranges of steps that somebody has looked at, without overlap, in order."""
    names: dict[int, str]
    """Of tracks of the shown run."""


class AlternativeInfo(Model):
    """What may be true at a doubtful place."""

    words: str
    probability: float
    as_it_is: bool


class Sight(Model):
    """Where in a camera's picture somebody would be whom no track has."""

    step: int
    camera: int
    box: tuple[float, float, float, float]
    """left, top, width, height, pixels."""


class DoubtInfo(Model):
    """A doubtful place."""

    id: str
    kind: Literal[
        "exchange", "join", "cut", "crossing", "gap", "short", "begins", "ends", "missing", "fast"
    ]
    title: str
    why: str
    first: int
    last: int
    tracks: list[int]
    places: list[tuple[int, float, float, float]]
    doubt: float
    """Probability that the run is wrong there."""
    stake: int
    """Steps that depend on it."""
    alternatives: list[AlternativeInfo]
    """As it is, then the most probable first."""
    sights: list[Sight]
    """Of who may be missing, at its places; empty for all others, whose boxes are their tracks'."""


class DoubtQueue(Model):
    """The doubtful places of the shown run, the most at stake first."""

    run: str | None
    complete: bool
    """Whether the run is."""
    how: str
    """By what they were judged."""
    answered: int
    """Places that corrections settle."""
    cameras: list[str]
    """Sentences about cameras whose boxes err more than those of the others."""
    doubts: list[DoubtInfo]


class GhostTrack(Model):
    """A track as it would be."""

    id: int
    first: int
    positions: list[Vector | None]
    """World metres, one a step from ``first`` on; null where it is not there."""


class ChangedSpan(Model):
    """A part of a track that would be another's."""

    id: int
    """Whose it would be; 0 for nobody's."""
    was: int
    first: int
    last: int


class AlternativePreview(Model):
    """What the tracks would be around a doubtful place, if an alternative were true."""

    tracks: list[GhostTrack]
    spans: list[ChangedSpan]
    """Over the whole recording."""


class CorrectionsState(Model):
    """How corrections stand."""

    key: str
    """Another for every change of them, or of what became of them: read them again."""
    count: int
    unmet: int

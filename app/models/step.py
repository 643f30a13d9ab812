"""One step of a run: what each camera found, the targets, the truth."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.base import Box, Model, Vector


class Measurement(Model):
    """A peak or detection that the camera's filter was given."""

    box: Box
    score: float
    track: int | None = None
    """Id of the track that it feeds; null where it is nobody's."""
    nearest: int | None = None
    """Of one that is nobody's: the track that it is nearest to."""
    sigmas: float | None = None
    """And how far that is, in standard deviations of where its box is expected."""
    gate: float | None = None
    """And within how many of them a box would have been taken for the track's."""


class Estimate(Model):
    """A camera's own 2D estimate."""

    box: Box
    weight: float
    label: int
    """-1 where the method has no labels."""


class CameraEvent(Model):
    """Something that happened to people in a camera's picture, as its method tells it."""

    kind: Literal["new", "vanished", "returned", "occluded", "merged", "split"]
    labels: list[int]
    """Labels of the camera's own 2D estimates."""


Gate = tuple[float, float, float, float, float]
"""An ellipse: centre x and y, and xx, xy, yy of the matrix C with (z − c)ᵀ C⁻¹ (z − c) = 1."""


Reason = Literal["out of view", "behind camera", "near the edge"]


class Feeding(Model):
    """The box associated with a track, as the single-view stage gave it to the fusion."""

    box: Box
    weight: float
    """Its weight, existence or detector's score."""
    share: float
    """Association probability: that this track made the box, 0 … 1."""


class CameraTrack(Model):
    """One 3D target as one camera should see it, and what that camera said of it."""

    id: int
    box: Box | None
    """Reprojected; null where a part is behind the camera."""
    seen: bool
    """Whether one of the camera's boxes is associated with it at this step."""
    detection_probability: float
    source: int
    """Index of the associated box among those that the camera gave the fusion, -1 for none."""
    fed_by: Feeding | None
    hidden_by: int | None
    """Id of the target that occludes it; null for none."""
    visible: bool
    reason: Reason | None
    """Why it is not, or hardly, visible."""
    centre: tuple[float, float] | None
    trail: list[tuple[int, float, float]] = Field(default_factory=list)
    """Steps from this one, x and y of the feet; only where asked for."""


class CameraTruth(Model):
    """Where a person really is in this picture."""

    id: int
    box: Box
    valid: bool
    """False where the position is not certain."""


class Candidate(Model):
    """What a camera's method looked at and did not believe."""

    box: Box
    gate: str
    """At which it fell, in words."""


class CameraStep(Model):
    """One camera at one step."""

    name: str
    measurements: list[Measurement]
    estimates: list[Estimate]
    samples: list[tuple[float, float, float]] | None = None
    """x, y and relative weight; only where asked for."""
    dropped: list[Candidate] | None = None
    """With the samples."""
    events: list[CameraEvent] = Field(default_factory=list)
    gates: list[Gate] = Field(default_factory=list)
    """Where the method expects its targets, in pixels."""
    foreground: str | None = None
    """``?run=`` of the foreground's address; null where the method has none."""
    likelihood: str | None = None
    """``?run=`` of the likelihood map's address; null without pictures or templates."""
    tracks: list[CameraTrack]
    truth: list[CameraTruth]
    information: dict[str, float]
    """Numbers of the method worth showing, by name."""


class Track(Model):
    """One 3D target at one step."""

    id: int
    position: Vector
    sigma: Vector
    existence: float
    """Weight or probability of existence."""
    seen: list[bool]
    """By camera."""
    height: tuple[float, float] | None = None
    """Height of the person while standing and its standard deviation, metres; null where it is not
    estimated."""


class Truth(Model):
    """Where a person really is."""

    id: int
    position: Vector
    valid: bool
    track: int | None = None
    """The track that is this person's at this step."""
    error: float | None = None
    """How far that is away, metres."""


class Step(Model):
    """One step of the shown run; the truth is there whether it is computed or not."""

    run: str
    """Key of the run that it is of; empty where none is shown."""
    revision: int
    """Of the run's people: a later one has others at steps that were there before."""
    step: int
    computed: bool
    cameras: list[CameraStep]
    tracks: list[Track]
    truth: list[Truth]
    components: int | None
    """The number of components of the filter; null where only the tracks of a run were stored."""
    cardinality: float | None
    """Expected number of people: the sum of the weights; null where only tracks were stored."""

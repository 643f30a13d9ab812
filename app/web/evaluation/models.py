"""What the routes of the evaluation answer, as types."""

from __future__ import annotations

from typing import Any, Literal

from app.models import Model
from app.state.scores import Reference
from tracker.evaluation.clear import PersonStatus
from tracker.evaluation.difference import Verdict
from tracker.evaluation.figures import Direction
from tracker.evaluation.tables import TrackKind


class FigureInfo(Model):
    """One figure of a run."""

    name: str
    """Its key."""
    label: str
    group: str
    value: float | int | None
    """Null where it is not defined."""
    unit: str
    digits: int
    """Decimals that matter."""
    direction: Direction
    """Which values are better."""
    help: str
    settings: str
    """What it was measured with, in words: distance, gate, cut-off, order, window."""
    source: str
    headline: bool
    """Whether a short table shows it."""


class PersonInfo(Model):
    """One person of the truth."""

    id: int
    first: int
    last: int
    steps: int
    tracked: int
    """Steps with a pair."""
    status: PersonStatus
    found_share: float
    mean_error: float | None
    """Metres; null without pairs."""
    error_95: float | None
    switches: int
    fragmentations: int
    track: int | None
    """The track that stands for the person in the identity figures."""


class ScoredTrackInfo(Model):
    """One track against the truth."""

    id: int
    first: int
    last: int
    steps: int
    matched: int
    """Steps with a pair."""
    ignored: int
    """Steps at which it matched a position that is not certain."""
    kind: TrackKind
    person: int | None
    """With whom it is paired most often."""
    person_share: float | None
    """Share of its steps that it is."""
    mean_error: float | None
    """To whomever it is paired with, in the unit of the distance."""
    switches: int
    """How often somebody's identity switched to this track."""


class CameraScoreInfo(Model):
    """One camera's reprojected boxes against the truth projected the same way."""

    camera: str
    people: int
    estimates: int
    error: float | None
    """Pixels."""
    error_95: float | None
    overlap: float | None
    found_share: float | None
    false_per_picture: float | None


class EvaluationInfo(Model):
    """The shown run against the truth."""

    run: str
    steps: int
    """Steps 0 … ``steps`` − 1 were scored."""
    partial: bool
    """Whether the run was not finished: steps are missing, or smoothing was still to come."""
    settings: dict[str, Any]
    figures: list[FigureInfo]
    per_person: list[PersonInfo]
    per_track: list[ScoredTrackInfo]
    cameras: list[CameraScoreInfo]
    notes: list[str]
    """What a reader of the figures must know."""
    changes: int
    """How many parameters are not at the defaults of the recording."""


class PersonError(Model):
    """A person's position error over time."""

    person: int
    first: int
    """The first step of the first value's bucket."""
    values: list[float | None]
    """Metres; null where there is no pair."""


class TrackError(Model):
    """A track's distance to whomever it is paired with, over time."""

    track: int
    first: int
    values: list[float | None]


class Switch(Model):
    """A person's identity switched."""

    step: int
    person: int
    before: int
    """The track until then."""
    track: int


class EvaluationSeries(Model):
    """A run against the truth over time: one value a bucket of steps.

    Of a bucket with several steps the worst is told: that with the greatest OSPA, for
    GOSPA and its parts that with the greatest GOSPA, for errors the greatest error.
    """

    run: str
    of: Literal["shown", "pinned", "previous"]
    steps: int
    partial: bool
    first: int
    """The first step of the first bucket."""
    stride: int
    """Steps a bucket: 1 where each step has its own value."""
    unit: str
    """Of the distance: m, or none for boxes."""
    cost: str
    """Cut-off and order of OSPA and GOSPA, in words."""
    gate: str
    """The gate of errors and switches, in words."""
    ospa: list[float]
    ospa_localisation: list[float]
    ospa_cardinality: list[float]
    ospa2: list[float]
    gospa: list[float]
    gospa_localisation: list[float]
    gospa_missed: list[float]
    gospa_false: list[float]
    """The parts of GOSPA are p-th powers and sum to its p-th power."""
    ospa_share: list[float]
    gospa_share: list[float]
    """How much of each is location, 0 … 1; of GOSPA by its powers."""
    mean_error: list[float | None]
    """Metres, over the tracks; null where there is no pair."""
    axes: dict[Literal["ospa", "gospa", "error"], float]
    """Round upper ends for plots; a few spikes leave them."""
    truth: list[int]
    estimates: list[int]
    misses: list[int]
    false_positives: list[int]
    errors: list[PersonError]
    track_errors: list[TrackError]
    switches: list[Switch]


class Scores(Model):
    """What the page shows of a run against the truth: figures, and what lies over time."""

    evaluation: EvaluationInfo
    series: EvaluationSeries
    reference: EvaluationSeries | None
    """The series of the run that it is compared with; null where there is none."""


class ComparedRun(Model):
    """One side of a comparison."""

    run: str
    steps: int
    partial: bool
    changed: dict[str, Any]
    """Values that are not the default."""


class DifferenceInfo(Model):
    """One figure of two runs: A the reference, B the shown run."""

    name: str
    label: str
    unit: str
    digits: int
    direction: Direction
    headline: bool
    a: float | int | None
    b: float | int | None
    difference: float | int | None
    """B − A."""
    verdict: Verdict
    """What B is."""
    comparable: bool
    """False where the two were measured with different settings."""
    settings: str


class ParameterDifference(Model):
    """A parameter that the two runs do not share."""

    key: str
    a: Any
    b: Any


class Comparison(Model):
    """The shown run against the pinned or the previous one, over the steps that both have."""

    against: Reference
    steps: int
    """Steps that both were scored over."""
    a: ComparedRun
    b: ComparedRun
    parameters: list[ParameterDifference]
    rows: list[DifferenceInfo]

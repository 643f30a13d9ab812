"""Looking into a planned import in the background: checks, clocks, pairs of cameras, the room."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from app.state.teaching import entrances_of
from tracker.geometry.camera import Camera
from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.entrances import Door
from tracker.io.checks import Check
from tracker.io.checks.boxes import check_boxes, judge_boxes
from tracker.io.checks.cameras import check_lenses, check_places
from tracker.io.checks.synchronisation import CameraOffset, synchronise
from tracker.io.checks.timing import check_counting, check_time
from tracker.io.checks.truth import check_truth
from tracker.io.conventions.judge import EVERY_ORDER
from tracker.io.importing.remedies import for_import
from tracker.io.importing.settling import ImportPlan
from tracker.io.importing.writing import as_sequence
from tracker.parameters.catalogue import METHODS
from tracker.runs.fitting import default_parameters, unfit_methods
from tracker.runs.pipeline import Cancelled, compute
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.rectification.sequence import check_shake

CELLS = 72
"""Of the longer side."""

MARGIN = 0.6
"""Metres around room and cameras."""

MOST_FEET = 300
_FARTHEST = 15.0  # metres from the room that a camera may be to be in the plan
_ABOVE = 0.05  # metres above the floor, so that it is not cut off by rounding


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What is drawn of a room from above, metres. H by W cells."""

    origin: tuple[float, float]
    """Of the first cell's corner."""
    cell: float
    seen: Int[ndarray, "H W"]
    """How many cameras see the middle of each cell; rows go along y."""
    cameras: tuple[tuple[float, float, float, float], ...]
    """x, y, direction and half the angle across, radians."""
    feet: Float[ndarray, "N 2"]
    """Where boxes of two cameras show feet."""


def draw_plan(settled: ImportPlan, agreed: Consensus | None) -> Plan:
    """The plan of a settled recording.

    Args:
        settled: Whose cameras and room.
        agreed: What the boxes agree on, where there are any.
    """
    cameras = [view.camera for view in settled.views]
    corners = [
        settled.room.minimum, settled.room.maximum,
        settled.suggested.minimum, settled.suggested.maximum,
    ]  # fmt: skip
    low, high = np.min(corners, axis=0)[:2], np.max(corners, axis=0)[:2]
    near = [
        c.centre[:2]
        for c in cameras
        if (np.abs(np.clip(c.centre[:2], low, high) - c.centre[:2]) < _FARTHEST).all()
    ]
    low, high = np.min([low, *near], axis=0) - MARGIN, np.max([high, *near], axis=0) + MARGIN
    cell = float((high - low).max()) / CELLS
    width, height = (max(1, int(np.ceil(side / cell))) for side in high - low)
    x, y = np.meshgrid(
        low[0] + (np.arange(width) + 0.5) * cell, low[1] + (np.arange(height) + 0.5) * cell
    )
    floor = np.full(x.size, float(settled.room.minimum[2]) + _ABOVE)
    points = np.column_stack([x.ravel(), y.ravel(), floor])
    seen = np.sum([camera.sees(points) for camera in cameras], axis=0).reshape(height, width)
    feet = np.zeros((0, 2)) if agreed is None else agreed.feet[:, :2]
    if len(feet) > MOST_FEET:
        feet = feet[np.linspace(0, len(feet) - 1, MOST_FEET).astype(int)]
    return Plan(
        (float(low[0]), float(low[1])), cell, seen, tuple(_look(camera) for camera in cameras), feet
    )


def _look(camera: Camera) -> tuple[float, float, float, float]:
    width, height = camera.image_size
    middle = (height - 1) / 2.0
    ends = camera.back_project(np.array([[0.0, middle], [width - 1.0, middle]]))
    ahead = camera.rotation[2]
    flat = float(np.hypot(ahead[0], ahead[1]))
    # a camera that looks straight down looks nowhere from above: along its picture's upper edge
    way = ahead if flat > 0.05 else -camera.rotation[1]
    cosine = float(ends[0] @ ends[1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[1]))
    return (
        float(camera.centre[0]),
        float(camera.centre[1]),
        float(np.arctan2(way[1], way[0])),
        float(np.arccos(np.clip(cosine, -1.0, 1.0)) / 2.0),
    )


MOST_STEPS = 200
"""Of which pictures are compared; boxes are compared at all steps."""

MOST_TRACKED = 1500
"""Steps of the first run, which tells where people come in."""

FEW = 0.25
"""Of the share of boxes that meet in the best pair: a pair with less is odd."""


@dataclass(frozen=True, slots=True)
class Pair:
    """How well the boxes of two cameras meet."""

    first: str
    second: str
    share: float
    """Of the boxes that could, how many do."""
    pixels: float
    """The usual distance between the rays, in the usual box; NaN where none meet."""
    odd: bool


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """What is known so far."""

    plan: Plan
    checks: tuple[Check, ...] = ()
    pairs: tuple[Pair, ...] = ()
    offsets: tuple[CameraOffset, ...] = ()
    doors: tuple[Door, ...] = ()
    """Where the tracks of a first run on the boxes begin and end."""
    fitting: Mapping[str, str] = field(default_factory=dict)
    """The methods that it is tracked with unless somebody wishes otherwise."""
    unfit: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """The methods that cannot work on it, each with the reason."""
    under_way: str = "boxes"
    """What is being looked into; empty when all is done."""


def look_into(settled: ImportPlan, name: str, cancelled: Callable[[], bool]) -> Iterator[Looked]:
    """Everything that can be said before an import, the quick things first.

    Args:
        settled: The recording.
        name: The name of the sequence.
        cancelled: Asked between two pictures.

    Raises:
        Cancelled: As soon as it is noticed.
    """
    sequence = as_sequence(settled, name)
    looked = _with_methods(Looked(draw_plan(settled, None)), sequence)
    yield looked
    judged = judge_boxes(sequence, exchanges=len(sequence.views) <= EVERY_ORDER)
    _stop_if(cancelled)
    checks = [*check_boxes(sequence, judged), check_lenses(sequence.cameras)]
    mistaken = judged is not None and judged.mistaken
    if not mistaken:
        checks += check_places(sequence.cameras, sequence.room)
    counting = [] if judged is None else [check_counting(sequence, places=not mistaken)]
    if not mistaken:
        counting.append(check_truth(sequence))
    agreed = None if judged is None else judged.given.consensus
    looked = replace(
        looked,
        plan=draw_plan(settled, agreed),
        checks=(*checks, *counting),
        pairs=() if agreed is None else _pairs(sequence, agreed),
        under_way="" if mistaken or len(sequence.views) < 2 else "clocks",
    )
    looked = replace(looked, checks=_for_import(looked.checks, settled))
    yield looked
    if mistaken:
        return
    with _Stoppable(sequence, cancelled) as reader:
        offsets: tuple[CameraOffset, ...] = ()
        if len(sequence.views) > 1:
            offsets = synchronise(sequence, reader=reader, most_steps=MOST_STEPS)
        _stop_if(cancelled)
        verdict = None if judged is None else judged.verdict
        timing = list(check_time(sequence, found=offsets, verdict=verdict))
        found = _for_import((*checks, *timing, *counting), settled)
        looked = replace(looked, checks=found, offsets=offsets, under_way="first tracks")
        if agreed is not None and sequence.has_detections:
            yield looked
            looked = replace(looked, doors=tuple(_doors(sequence, cancelled)))
        if sequence.has_pictures:
            yield replace(looked, under_way="cameras' stands")
            looked = replace(looked, checks=(*found, *check_shake(sequence, reader)))
    yield replace(looked, under_way="")


def _with_methods(looked: Looked, sequence: Sequence) -> Looked:
    try:
        values = default_parameters(sequence)
    except ValueError:  # neither pictures nor boxes: it cannot be imported yet
        return looked
    fitting = {str(key): str(getattr(values, key)) for key in METHODS}
    unfit = {str(key): names for key, names in unfit_methods(sequence, values).items()}
    return replace(looked, fitting=fitting, unfit=unfit)


def _doors(sequence: Sequence, cancelled: Callable[[], bool]) -> list[Door]:
    """Where the people of the boxes come in; pictures are not looked at."""
    views = tuple(replace(view, video=None, images=()) for view in sequence.views)
    sequence = replace(sequence, views=views)
    values = default_parameters(sequence)
    return entrances_of(compute(sequence, values, steps=MOST_TRACKED, cancelled=cancelled))


def _for_import(checks: Iterable[Check], settled: ImportPlan) -> tuple[Check, ...]:
    return tuple(for_import(one, settled.reading) for one in checks)


def _stop_if(cancelled: Callable[[], bool]) -> None:
    if cancelled():
        raise Cancelled


class _Stoppable(FrameReader):
    """A reader that gives up as soon as nobody wants its pictures any more."""

    def __init__(self, sequence: Sequence, cancelled: Callable[[], bool]) -> None:
        super().__init__(sequence)
        self._cancelled = cancelled

    def iterate(self, *arguments: int, **named: int) -> Iterator[np.ndarray | None]:
        for picture in super().iterate(*arguments, **named):
            _stop_if(self._cancelled)
            yield picture

    def check(self) -> None:
        _stop_if(self._cancelled)
        super().check()


def _pairs(sequence: Sequence, agreed: Consensus) -> tuple[Pair, ...]:
    heights = [
        float(np.median(v.detections.boxes[:, 3]))
        for v in sequence.views
        if v.detections is not None and len(v.detections.boxes)
    ]
    usual = float(np.median(heights)) if heights else 0.0
    best = max(agreed.shares.values(), default=0.0)
    found: list[Pair] = []
    for (a, b), share in sorted(agreed.shares.items()):
        rows = (agreed.cameras == (a, b)).all(axis=1)
        gap = float(np.median(agreed.gaps[rows])) if rows.any() else float("nan")
        first, second = (sequence.views[k].camera.name for k in (a, b))
        found.append(Pair(first, second, share, gap * usual, share < FEW * best))
    return tuple(found)

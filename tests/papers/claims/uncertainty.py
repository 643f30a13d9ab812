"""Whether what a run states of its errors holds: ellipses, cameras, clocks and heights."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import (
    Context,
    Experiment,
    Finding,
    Result,
    Unavailable,
    Verdict,
)
from tests.random_rooms import random_room, with_boxes
from tests.rooms import ROOMS, render_random
from tests.rooms.random_rooms.wardrobe import dress
from tracker.evaluation.matching import assign
from tracker.runs.pipeline import compute, default_parameters
from tracker.runs.processes import WorkerControl
from tracker.runs.run import Run
from tracker.sequences.library import open_sequence
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.smoothing.camera_errors import CameraErrors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORDINGS = ("cmc1", "cmc2", "av163-seq45-3p-1111-points", "wildtrack-points-300")

FIRST_SEED = 1400
ROOMS_OF_WALKERS, CHANGED_ROOMS, EXACT_ROOMS, RENDERED_ROOMS, QUICK_ROOMS = 20, 12, 8, 8, 2

CAMERAS = 4
"""Cameras of a room of walkers."""

NOISE, NEARLY_EXACT = 0.03, 0.002
"""Standard deviation of the edges of boxes in rooms of walkers, box heights."""

LATEST = 0.15
"""Largest delay of a camera in a room of walkers, seconds, late or early."""

GATE = 1.0
"""Distance on the floor within which an estimate and a true position are matched, metres."""

ELLIPSE = -2.0 * np.log(0.05)
"""Squared Mahalanobis distance of the boundary of the 95 % ellipse."""

UNCHANGED, NOISIER = "unchanged", "boxes three times as noisy"
AXES = {"x": "turned up or down", "y": "turned sideways"}
"""Changes of a pose by the axis of the camera about which it is turned."""
ANGLES = (1, 2, 3)
CHANGES = (NOISIER, *(f"{words} by {angle}°" for words in AXES.values() for angle in ANGLES))

Kind = Literal["recording", "walkers", "exact", "built-in", "rendered"]

NAMES: dict[Kind, str] = {
    "recording": "recordings",
    "walkers": "random rooms",
    "exact": "random rooms, nearly exact boxes",
    "built-in": "built-in rooms",
    "rendered": "rendered random rooms",
}

CLAIM = (
    "What a run states of its own errors holds: 95 % ellipses contain the true positions, "
    "inconsistent cameras are named, clock offsets and heights are within 2 σ."
)


@dataclass(frozen=True, slots=True)
class Item:
    """A recording or room, and in how many of its cameras something is changed."""

    kind: Kind
    name: str
    """Name of the recording, or seed of the room."""
    folder: Path | None = None
    changed: int = 0


@dataclass(slots=True)
class Found:
    """What was measured in one recording or room."""

    inside: list[bool] = field(default_factory=list)
    """Whether the 95 % ellipse contains each true position that is matched."""
    delays: list[float] = field(default_factory=list)
    """Estimated delay of each camera, seconds."""
    late: list[tuple[float, float]] = field(default_factory=list)
    """Error of the delay of each camera that was made late, and its σ, seconds."""
    heights: list[tuple[float, float]] = field(default_factory=list)
    """Error of the height of each person, and its σ, metres."""
    factor: float | None = None
    """Largest factor between the errors of a camera and those of the others."""
    named: dict[str, list[bool | None]] = field(default_factory=dict)
    """For each change and camera whether the camera that is named is the changed one; None where
    none is named."""


Everything = dict[Kind, dict[str, Found]]


def run(context: Context) -> Result:
    """Track all recordings and rooms as they are, and with one camera after another changed."""
    notes, items = [], []
    for name in () if context.quick else RECORDINGS:
        try:
            sequence = runs.recording(context, name)
            items.append(Item("recording", name, sequence.folder, len(sequence.views)))
        except Unavailable as missing:
            notes.append(f"Left out: {missing}.")
    seeds = [f"{FIRST_SEED + k}" for k in range(ROOMS_OF_WALKERS)]
    changed = set(seeds[: QUICK_ROOMS if context.quick else CHANGED_ROOMS])
    items += [Item("walkers", seed, changed=int(seed in changed)) for seed in seeds]
    if context.quick:
        items = items[:QUICK_ROOMS]
    else:
        items += [Item("exact", seed) for seed in seeds[:EXACT_ROOMS]]
        items += [Item("built-in", name) for name in ROOMS]
        items += [Item("rendered", seed) for seed in seeds[:RENDERED_ROOMS]]
    answers = context.spread(_measure, items, words="recordings and rooms", steps=len(items))
    found: Everything = {}
    for item, one in zip(items, answers, strict=True):
        found.setdefault(item.kind, {})[item.name] = one
    notes.append(
        f"Default parameters, seed 0; random rooms of {CAMERAS} cameras from seed {FIRST_SEED}, "
        f"boxes with errors of {100 * NOISE:g} % of their height, nearly exact ones of "
        f"{100 * NEARLY_EXACT:g} %; rendered random rooms with the boxes that come with them. "
        f"Estimates and true positions are matched within {GATE:g} m on the floor."
    )
    notes.append(
        "One camera at a time is changed: independent noise is added to its boxes so that their "
        "standard deviation is three times the estimated one, or its pose is turned, either way at "
        "random. The true delays of the changed random rooms are up to "
        f"{LATEST:g} s either way, those of the recordings unknown. True heights are those of "
        "simulated and rendered people who walk or stand at some time."
    )
    return Result(
        head=("quantity", "measured in", ">of", "result"),
        rows=tuple(_rows(found)),
        numbers={k: {name: asdict(one) for name, one in own.items()} for k, own in found.items()},
        findings=_findings(found),
        figure=lambda: _draw(found),
        notes=tuple(notes),
    )


def _measure(item: Item, control: WorkerControl) -> Found:
    """Track one recording or room as it is, and with one camera after another changed."""
    with tempfile.TemporaryDirectory() as scratch:
        sequence, statures = _opened(item, Path(scratch))
        parameters = default_parameters(sequence)
        if item.kind == "rendered":  # whose boxes are of interest, and not the pictures
            parameters = parameters.model_copy(update={"single_view": "none"})
        track = partial(compute, parameters=parameters, cancelled=control.cancelled)
        first = track(sequence)
        found = _compared(first, statures)
    errors = _errors(first)
    if item.kind in ("recording", "walkers") and errors is not None:
        found.factor, found.delays = float(np.nanmax(errors.factors)), errors.delays.tolist()
        found.named[UNCHANGED] = [_named(errors, -1)]
    rng = np.random.default_rng(list(item.name.encode()))
    for camera in range(item.changed):
        for change, changed in _changes(first, camera, rng):
            found.named.setdefault(change, []).append(_named(_errors(track(changed)), camera))
    if item.kind == "walkers" and item.changed:
        late = rng.uniform(-LATEST, LATEST, CAMERAS)
        errors = _errors(track(random_room(int(item.name), cameras=CAMERAS, late=tuple(late))))
        if errors is not None:
            off = errors.delays - (late - late.mean())
            found.late = list(zip(off.tolist(), errors.delay_sigmas.tolist(), strict=True))
    control.advance(1)
    return found


def _opened(item: Item, scratch: Path) -> tuple[Sequence, dict[int, float]]:
    """A recording or room, and the heights of its people by id, where they are known."""
    if item.folder is not None:
        return read_sequence(item.folder), {}
    if item.kind == "built-in":
        cast = ROOMS[item.name].people
        return open_sequence(item.name), {k: p.look.stature for k, p in enumerate(cast, 1)}
    if item.kind == "rendered":
        choices = render_random(int(item.name), scratch / "room", detections=True)
        people = enumerate(zip(dress(choices), choices.behaviours, strict=True), 1)
        upright = {k: look.stature for k, (look, does) in people if does not in ("sits", "lies")}
        return read_sequence(scratch / "room"), upright
    noise = NOISE if item.kind == "walkers" else NEARLY_EXACT
    sequence = random_room(int(item.name), cameras=CAMERAS, noise=noise)
    truth = sequence.ground_truth
    assert truth is not None
    heights = 2.0 * truth.positions[truth.at(0), 2]
    return sequence, dict(enumerate(heights.tolist(), 1))


def _compared(run: Run, statures: dict[int, float]) -> Found:
    """Compare the tracks of a run with true positions and heights."""
    tracks, truth, found = run.tracks, run.sequence.ground_truth, Found()
    assert truth is not None
    rows: dict[int, list[int]] = {}
    for step in range(run.sequence.frames):
        people, own = truth.at(step), tracks.at(step)
        gaps = truth.positions[people, None, :2] - tracks.positions[None, own, :2]
        for who, which in zip(*assign(np.linalg.norm(gaps, axis=2), GATE), strict=True):
            if truth.valid[people.start + who]:
                row, gap = own.start + int(which), gaps[who, which]
                rows.setdefault(int(truth.ids[people.start + who]), []).append(row)
                spread = np.diag(tracks.sigmas[row, :2] ** 2)
                spread[[0, 1], [1, 0]] = tracks.covariances_xy[row]
                found.inside.append(bool(gap @ np.linalg.solve(spread, gap) < ELLIPSE))
    for person in statures.keys() & rows.keys():
        own_rows = np.array(rows[person])  # of them those of the track that has most
        row = own_rows[tracks.ids[own_rows] == np.bincount(tracks.ids[own_rows]).argmax()][0]
        error, sigma = tracks.heights[row] - statures[person], tracks.sigma_heights[row]
        if np.isfinite(error):
            found.heights.append((float(error), float(sigma)))
    return found


def _errors(run: Run) -> CameraErrors | None:
    """The errors of the cameras that a run states."""
    return None if run.smoothed is None else run.smoothed.cameras


def _named(errors: CameraErrors | None, camera: int) -> bool | None:
    """Whether the camera that is named is the changed one; None where none is named."""
    named = None if errors is None else errors.out_of_line
    return None if named is None else named[0] == camera


def _changes(run: Run, camera: int, rng: np.random.Generator) -> Iterator[tuple[str, Sequence]]:
    """The sequence of a run with one of its cameras changed, in every way."""
    view = run.sequence.views[camera]
    noise = None if run.smoothed is None else run.smoothed.noise
    if noise is not None and view.detections is not None:
        boxes = view.detections.boxes.copy()
        # with the errors that are there, the variance is nine times theirs
        sigmas = np.sqrt(8.0 * noise.variances(boxes[:, 3] / 2.0)[:, :3])
        across, top, bottom = (sigmas * rng.standard_normal(sigmas.shape)).T
        boxes += np.column_stack([across, top, np.zeros(len(top)), bottom - top])
        boxes[:, 3] = np.maximum(boxes[:, 3], 1.0)
        yield NOISIER, with_boxes(run.sequence, {camera: replace(view.detections, boxes=boxes)})
    for axis, words in AXES.items():
        for angle in ANGLES:
            signed = float(angle * rng.choice([-1, 1]))
            turn = Rotation.from_euler(axis, signed, degrees=True).as_matrix()
            rotation = turn @ view.camera.rotation
            moved = replace(
                view.camera, rotation=rotation, translation=-rotation @ view.camera.centre
            )
            views = list(run.sequence.views)
            views[camera] = replace(view, camera=moved)
            yield f"{words} by {angle}°", replace(run.sequence, views=tuple(views))


def _pooled(found: Everything, *kinds: Kind) -> Iterator[tuple[str, list[Found]]]:
    """Each recording by itself, and all rooms of a kind together."""
    for kind in kinds:
        if kind == "recording":
            yield from ((name, [one]) for name, one in found.get(kind, {}).items())
        elif kind in found:
            yield f"{len(found[kind])} {NAMES[kind]}", list(found[kind].values())


def _by_change(found: Everything, kind: Kind, change: str) -> list[bool | None]:
    """For each camera that was changed so whether it is the one that is named."""
    return [n for one in found.get(kind, {}).values() for n in one.named.get(change, [])]


def _rows(found: Everything) -> Iterator[tuple[str, ...]]:
    """The table: quantity, where it was measured, in how many cases, and the result."""
    for name, own in _pooled(found, *NAMES):
        inside = [one for each in own for one in each.inside]
        share = f"{np.mean(inside):.3f}"
        yield "true position in the 95 % ellipse", name, f"{len(inside)} positions", share
    named = "inconsistent camera named: {}".format
    for name, own in _pooled(found, "recording", "walkers"):
        factor = max(each.factor for each in own if each.factor is not None)
        wrong = sum(one is not None for each in own for one in each.named[UNCHANGED])
        cameras = f"{sum(len(each.delays) for each in own)} cameras"
        yield named(UNCHANGED), name, cameras, f"{wrong}; largest factor {factor:.2f}"
    for change in CHANGES:
        for kind, every in found.items():
            if right := _by_change(found, kind, change):
                where = f"{sum(change in one.named for one in every.values())} {NAMES[kind]}"
                other = f"; another one {right.count(False)}" if False in right else ""
                result = f"{right.count(True)}{other}"
                yield named(change), where, f"{len(right)} cameras", result
    for name, own in _pooled(found, "recording"):
        delays = ", ".join(_signed(delay, 2) for delay in own[0].delays)
        yield "delays of the cameras", name, f"{len(own[0].delays)} cameras", f"{delays} s"
    for kind, every in found.items():
        rooms = every.values()
        for quantity, of, unit, groups in (
            ("error of the delays", "cameras", "s", [one.late for one in rooms if one.late]),
            ("error of the heights", "people", "m", [one.heights for one in rooms if one.heights]),
        ):
            if pairs := [pair for group in groups for pair in group]:
                errors, sigmas = np.array(pairs).T
                # of all delays together nothing is known
                mean = f", mean {_signed(errors.mean(), 3)} m" if unit == "m" else ""
                result = (
                    f"median {np.median(abs(errors)):.3f} {unit}, largest {max(abs(errors)):.3f} "
                    f"{unit}{mean}; σ {sigmas.min():.3f} to {sigmas.max():.3f} {unit}; "
                    f"{_within(pairs).count(True)} within 2 σ"
                )
                yield quantity, f"{len(groups)} {NAMES[kind]}", f"{len(pairs)} {of}", result


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}".replace("-", "−")


def _within(pairs: list[tuple[float, float]]) -> list[bool]:
    return [abs(error) < 2.0 * sigma for error, sigma in pairs]


def _findings(found: Everything) -> tuple[Finding, ...]:
    every = [one for own in found.values() for one in own.values()]
    alarms = [n for one in every for n in one.named.get(UNCHANGED, [])]
    named = len(alarms) - alarms.count(None)
    findings = [
        Finding(
            "no camera is named as inconsistent where none was changed",
            f"{named} in {len(alarms)} recordings and rooms",
            "worse" if named else "better",
        )
    ]
    groups = {
        "true positions in 95 % ellipses": {
            name: [inside for one in own for inside in one.inside]
            for name, own in _pooled(found, *NAMES)
        },
        "clock offsets within 2 σ": {"all": [w for one in every for w in _within(one.late)]},
        "heights within 2 σ": {"all": [w for one in every for w in _within(one.heights)]},
    }
    for claim, shares in groups.items():
        share, poorest = min((float(np.mean(own)), name) for name, own in shares.items())
        count = len(shares[poorest])
        where = "" if poorest == "all" else f", the least of all, on {poorest}"
        verdict: Verdict = "better" if share >= 0.95 else "worse"
        findings.append(Finding(f"95 % of {claim}", f"{share:.3f} of {count}{where}", verdict))
    return tuple(findings)


def _draw(found: Everything) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(11.0, 3.6, "What a run states of its own errors")
    shown: tuple[Kind, ...] = ("recording", "walkers")
    plots = drawing.panels(figure, [list(shown)])
    for k, kind in enumerate(shown):
        named = [_by_change(found, kind, change) for change in CHANGES]
        shares = [one.count(True) / len(one) if one else None for one in named]
        tones = [drawing.colour(k)] * len(CHANGES)
        drawing.bars(plots[kind], list(CHANGES), shares, tones, named=not k)
        plots[kind].set_title(f"{NAMES[kind]}: share of changed cameras that are named")
    return figure


EXPERIMENT = Experiment("uncertainty", CLAIM, run)

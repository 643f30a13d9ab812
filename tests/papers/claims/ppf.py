"""Targets that look alike: the pseudo particle filter against the classical particle filter."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.papers.claims import cameras
from tests.papers.clips import clip as clips
from tests.papers.clips.ppf import CLIPS
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker import single_view
from tracker.evaluation.figures import number
from tracker.evaluation.matching import assign
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs.pipeline import Cancelled
from tracker.runs.processes import WorkerControl
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEDS, QUICK_SEEDS = 20, 1
QUICK_STEPS = 120

SETTLING = 1.0
"""Seconds from a clip's start that do not count: nobody is told where the targets are."""

CLASSICAL, PSEUDO, ROBUST = "particle filter", "pseudo particle filter", "pseudo, robust"

FOLLOWED, LOST = 0.9, 0.5
"""Share of frames with every target from which all are followed, and up to which they are not."""

CLAIM = (
    "Where targets look alike a particle filter's one mean diverges; clusters of the particles "
    "follow every target, also through an occlusion and changing light."
)


def methods() -> dict[str, RunParameters]:
    """The filters that are compared, by name: two as published, and the defaults."""
    base = RunParameters(single_view="pseudo_particle")
    published = with_values(base, PRESETS["published"])
    return {
        CLASSICAL: with_values(published, {"pseudo_particle.filter": "classical"}),
        PSEUDO: published,
        ROBUST: base,
    }


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One camera's pictures and who is to be found in them."""

    name: str
    sequence: Sequence
    camera: int
    steps: int
    truth: Float[ndarray, "K A 4"]
    """Centre and half sizes of each target at each step, pixels; NaN where it is not there."""
    counts: Bool[ndarray, "K A"]
    """Where its truth is certain and the filters have had their time to settle."""


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """What a filter made of a scene, with every seed."""

    found: Float[ndarray, "R K A"]
    """1 where a target has an estimate of its own within its radius, 0 where not, else NaN."""
    astray: Float[ndarray, "R K"]
    """Share of the estimates that lie on no target; NaN where there is none."""
    path: tuple[Float[ndarray, "E 4"], ...]
    """Of the first seed: step, label, centre x and y of its estimates."""


def run(context: Context) -> Result:
    """Every filter on every clip, and on the cameras of the real recording, with every seed."""
    seeds = context.seeds_of(SEEDS, QUICK_SEEDS)
    with tempfile.TemporaryDirectory(prefix="multiview-phd-") as folder:
        scenes = list(_drawn(context, Path(folder)))
        real, notes = _recorded(context)
        scenes += real
        work = [(scene, name, seeds) for scene in scenes for name in methods()]
        answers = context.spread(
            follow,
            work,
            words=f"{len(methods())} filters, {len(scenes)} scenes, {seeds} seeds",
            steps=sum(scene.steps * seeds for scene, _, _ in work),
        )
    followed: dict[str, dict[str, Followed]] = {scene.name: {} for scene in scenes}
    for (scene, name, _), answer in zip(work, answers, strict=True):
        followed[scene.name][name] = answer
    measured = {
        scene.name: {name: summed_up(f, scene) for name, f in followed[scene.name].items()}
        for scene in scenes
    }
    return Result(
        head=("scene", "filter", ">every target", ">worst seed", ">each target", ">astray"),
        rows=tuple(
            (
                scene if index == 0 else "",
                name,
                *(number(figures[key], 3) for key in ("every", "worst", "each", "astray")),
            )
            for scene, filters in measured.items()
            for index, (name, figures) in enumerate(filters.items())
        ),
        numbers={
            "seeds": seeds,
            "settling_seconds": SETTLING,
            "scenes": measured,
            "parameters": {name: changed_values(p) for name, p in methods().items()},
        },
        findings=_findings(measured),
        figure=lambda: _draw(scenes[1], followed[scenes[1].name], measured),
        notes=(
            f"Mean of {seeds} seeds: share of frames with an estimate of its own within the radius "
            "of every target; in the worst seed; share of targets that have one; share of "
            f"estimates on nobody. The first {SETTLING:g} s are left out.",
            f"{CLASSICAL} and {PSEUDO}: as published; {ROBUST}: the defaults.",
            *notes,
        ),
    )


def _drawn(context: Context, folder: Path) -> Iterator[Scene]:
    for index, (name, make) in enumerate(CLIPS.items()):
        context.told("drawing the clips", index, len(CLIPS))
        if context.cancelled():
            raise Cancelled
        clip = make()
        sequence = clips.write(clip, folder / name)
        steps = min(QUICK_STEPS, clip.steps) if context.quick else clip.steps
        truth = np.array([clip.boxes(step) for step in range(steps)])
        yield Scene(
            name, sequence, 0, steps, truth, _settled(np.isfinite(truth[:, :, 0]), clip.fps)
        )


def _recorded(context: Context) -> tuple[list[Scene], list[str]]:
    try:
        sequence = runs.recording(context, cameras.RECORDING)
    except Unavailable as missing:
        return [], [f"Left out: {missing}."]
    steps = min(cameras.QUICK_STEPS, sequence.frames) if context.quick else sequence.frames
    scenes = []
    for index, camera in enumerate(sequence.cameras[: 1 if context.quick else None]):
        boxes, certain = _true_boxes(sequence, index, steps)
        name = f"{sequence.name.split('-2p')[0]} {camera.name}"
        counts = _settled(certain, sequence.fps)
        scenes.append(Scene(name, sequence, index, steps, boxes, counts))
    return scenes, [f"{cameras.RECORDING}: heads whose truth is certain, in frames with any."]


def _true_boxes(
    sequence: Sequence, camera: int, steps: int
) -> tuple[Float[ndarray, "K A 4"], Bool[ndarray, "K A"]]:
    """The true boxes in one camera, NaN where out of its picture, and which are certain."""
    truth = sequence.ground_truth
    assert truth is not None
    names = np.unique(truth.ids)
    boxes = np.full((steps, len(names), 4), np.nan)
    certain = np.zeros((steps, len(names)), dtype=bool)
    seen, visible = upright_boxes(
        sequence.cameras[camera], truth.positions, sequence.target_half_extents
    )
    kept = visible & (truth.frames < steps)
    places = truth.frames[kept], np.searchsorted(names, truth.ids[kept])
    boxes[places] = seen[kept]
    certain[places] = truth.valid[kept]
    return boxes, certain


def _settled(counts: Bool[ndarray, "K A"], fps: float) -> Bool[ndarray, "K A"]:
    counts = counts.copy()
    counts[: round(SETTLING * fps)] = False
    return counts


def follow(item: tuple[Scene, str, int], control: WorkerControl) -> Followed:
    """One filter on one scene with every seed."""
    scene, name, seeds = item
    found = np.full((seeds, scene.steps, scene.truth.shape[1]), np.nan)
    astray = np.full((seeds, scene.steps), np.nan)
    path: list[ndarray] = []
    with FrameReader(scene.sequence) as reader:
        pictures = [reader.picture(scene.camera, step) for step in range(scene.steps)]
        method = single_view.create(
            "pseudo_particle", scene.sequence, scene.camera, methods()[name], reader
        )
        for seed in range(seeds):
            state = method.start()
            for step, picture in enumerate(pictures):
                if control.cancelled():
                    raise Cancelled
                rng = np.random.default_rng((seed, scene.camera, step))
                state, result = method.step(state, step, picture, rng)
                found[seed, step], astray[seed, step] = compare(
                    scene.truth[step], scene.counts[step], result.estimates
                )
                if seed == 0:
                    path.append(_rows(step, result))
                control.advance(1)
    return Followed(found, astray, tuple(path))


def compare(
    truth: Float[ndarray, "A 4"], counts: Bool[ndarray, " A"], estimates: Float[ndarray, "E 4"]
) -> tuple[Float[ndarray, " A"], float]:
    """Whether each target that counts has an estimate of its own within its radius (NaN: it
    does not count), and the share of the estimates that lie on nobody."""
    found = np.full(len(truth), np.nan)
    if not counts.any():
        return found, np.nan
    there = np.flatnonzero(np.isfinite(truth[:, 0]))
    apart = truth[there, None, :2] - estimates[None, :, :2]
    radii = np.linalg.norm(apart / truth[there, None, 2:], axis=2)
    rows, _ = assign(radii, 1.0)
    found[counts] = 0.0
    found[np.intersect1d(there[rows], np.flatnonzero(counts))] = 1.0
    return found, float((radii.min(axis=0) > 1.0).mean()) if len(estimates) else np.nan


def _rows(step: int, result: ViewResult) -> Float[ndarray, "E 4"]:
    labels = result.estimate_labels
    return np.column_stack([np.full(len(labels), step), labels, result.estimates[:, :2]])


def summed_up(followed: Followed, scene: Scene) -> dict[str, Any]:
    counted = scene.counts.any(axis=1)
    # of each seed; a target that does not count is not missed
    every = np.fmin.reduce(followed.found[:, counted], axis=2).mean(axis=1)
    astray = followed.astray[np.isfinite(followed.astray)]
    return {
        "frames": int(counted.sum()),
        "targets": scene.truth.shape[1],
        "every": float(every.mean()),
        "worst": float(every.min()),
        "each": float(np.nanmean(followed.found)),
        "astray": float(astray.mean()) if len(astray) else None,
    }


def _findings(measured: dict[str, dict[str, dict[str, Any]]]) -> tuple[Finding, ...]:
    def every(scene: str, name: str) -> float:
        return float(measured[scene][name]["every"])

    def found(scene: str) -> str:
        return (
            f"{scene}: {100.0 * every(scene, PSEUDO):.1f} % of the frames against "
            f"{100.0 * every(scene, CLASSICAL):.1f} %; with the defaults "
            f"{100.0 * every(scene, ROBUST):.1f} %"
        )

    cup = min(every("REDCUP", CLASSICAL), every("REDCUP", PSEUDO))
    return (
        Finding(
            "one target is followed by either filter",
            found("REDCUP"),
            "better" if cup >= FOLLOWED else "worse",
        ),
        *(
            Finding(claim, found(scene), "better" if good else "worse")
            for claim, scene, good in (
                (
                    "two alike are followed, where the particle filter diverges",
                    "2BALL",
                    every("2BALL", PSEUDO) >= FOLLOWED and every("2BALL", CLASSICAL) <= LOST,
                ),
                (
                    "three alike are followed through an occlusion and changing light",
                    "3FACE",
                    every("3FACE", PSEUDO) >= FOLLOWED and every("3FACE", CLASSICAL) <= LOST,
                ),
            )
        ),
    )


def _draw(
    scene: Scene, followed: dict[str, Followed], measured: dict[str, dict[str, dict[str, Any]]]
) -> Figure:
    from tests.papers.laboratory import drawing

    names = list(methods())
    figure = drawing.sheet(11.0, 6.2, f"Targets that look alike: {scene.name} over time, and all")
    layout = [[f"{name} {axis}" for name in names[:2]] + ["shares"] for axis in "xy"]
    plots = drawing.panels(figure, layout, width_ratios=[1.15, 1.15, 1.0])
    for name in names[:2]:
        for row, axis in enumerate("xy"):
            plot = plots[f"{name} {axis}"]
            for target in range(scene.truth.shape[1]):
                plot.plot(scene.truth[:, target, row], color=drawing.MUTED, lw=3.5, alpha=0.35)
            dots = np.concatenate(followed[name].path)
            tones = [drawing.colour(int(label) - 1) for label in dots[:, 1]]
            plot.scatter(dots[:, 0], dots[:, 2 + row], s=3.0, c=tones, linewidths=0)
            plot.set_ylabel(f"{axis} (px)")
            if row == 0:
                plot.set_title(f"{name} (truth in grey)")
            else:
                plot.set_xlabel("step")
    labels, values, tones = [], [], []
    for scene_name, filters in measured.items():
        for index, name in enumerate(names):
            labels.append(f"{scene_name}: {name}")
            values.append(filters[name]["every"])
            tones.append(drawing.colour(index))
    drawing.bars(plots["shares"], labels, values, tones, named=True)
    plots["shares"].set_title("share of frames with every target")
    return figure


EXPERIMENT = Experiment("ppf", CLAIM, run)

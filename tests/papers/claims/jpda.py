"""Two people who look alike meet and part: data association with five cases and without.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.papers.claims import cameras
from tests.papers.clips import clip as clips
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker import single_view
from tracker.evaluation.figures import number
from tracker.evaluation.matching import assign
from tracker.geometry.assignment import linear_sum_assignment
from tracker.geometry.boxes import Boxes
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs.pipeline import Cancelled
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS, SIZE = 233, (384, 288)
HALF_SIZES = (4.0, 9.0)
CLOTHES = ((40.0, 45.0, 50.0), (120.0, 140.0, 205.0), (150.0, 60.0, 50.0), (70.0, 60.0, 60.0))

SEEDS, QUICK_SEEDS = 6, 1
"""Clips: the same meetings on other irregular paths."""

QUICK_STEPS = 60
"""Of the recording, which no claim is judged by."""

SETTLING = 10
"""Steps from the start that do not count: newcomers have to be confirmed."""

CLASSICAL, PUBLISHED, DEFAULTS = "classical JPDA", "five cases, as published", "five cases, ours"

LARGEST_ERROR, FRAMES_A_SECOND, FAR_MORE = 4.0, 11.0, 2.0
"""What the patent reports, in pixels and frames a second; and what "far more" is at least."""

CLAIM = (
    "With five cases told apart, data association follows two people who cross, merge and split "
    "within 4 px, where the classical filter errs far more; at about 11 frames a second."
)


def methods() -> dict[str, RunParameters]:
    """The filters that are compared, by name; all of them look at the same foreground."""
    base = RunParameters(single_view="jpda")
    pieces = {"jpda.foreground_box": "piece", "jpda.confirmation_steps": 1}
    published = {k: v for k, v in PRESETS["published"].items() if k.startswith("jpda.")}
    return {
        CLASSICAL: with_values(base, {"jpda.five_cases": False, **pieces}),
        PUBLISHED: with_values(base, published),
        DEFAULTS: base,
    }


def clip(seed: int) -> clips.Clip:
    """Two of the same clothes: they cross, walk together, part, cross again and part."""
    middle = clips.through(
        STEPS,
        [(0, 192, 140), (85, 210, 150), (105, 230, 158), (130, 262, 165), (150, 240, 170),
         (160, 225, 168), (232, 150, 150)],
        sway=8.0,
        seed=50 + seed,
    )  # fmt: skip
    apart = clips.through(
        STEPS,
        [(0, 150, 22), (40, 38, 8), (52, -20, -6), (70, -60, -14), (95, -3, 1), (150, 3, -1),
         (172, 40, 10), (190, 4, 3), (205, -35, 8), (232, -90, -20)],
        sway=6.0,
        seed=90 + seed,
    )  # fmt: skip
    sizes = clips.constant_size(STEPS, *HALF_SIZES)
    people = tuple(
        clips.Actor(name, path, sizes, CLOTHES)
        for name, path in (("one", middle - apart), ("other", middle + apart))
    )
    return clips.Clip(f"meeting {seed}", clips.wall(SIZE, seed=seed), people, np.ones(STEPS),
                      seed=seed)  # fmt: skip


def run(context: Context) -> Result:
    """Follow the two in every clip, and the people of the recording in each of its cameras."""
    seeds = context.seeds_of(SEEDS, QUICK_SEEDS)
    measured: dict[str, dict[str, Any]] = {name: {"errors": [], "seconds": 0.0, "switches": 0}
                                           for name in methods()}  # fmt: skip
    first: dict[str, list[ViewResult]] = {}
    middle = 0.0
    for seed in range(seeds):
        scene = clip(seed)
        truth = np.array([scene.boxes(step)[:, :2] for step in range(STEPS)])
        with tempfile.TemporaryDirectory() as folder:
            sequence = clips.write(scene, Path(folder))
            for index, (name, parameters) in enumerate(methods().items()):
                context.told("two who meet", seed * len(measured) + index, seeds * len(measured))
                results, seconds = _follow(context, sequence, 0, parameters, STEPS)
                errors, switches = centre_errors(truth, results)
                measured[name]["errors"].append(errors)
                measured[name]["seconds"] += seconds
                measured[name]["switches"] += switches
                first.setdefault(name, results)
                if name == PUBLISHED:
                    middle = max(middle, error_of_the_middle(scene, results))
    notes = [
        f"{seeds} clips of {STEPS} frames, {SIZE[0]}×{SIZE[1]}, two people of "
        f"{2 * HALF_SIZES[0]:g}×{2 * HALF_SIZES[1]:g} px. Centre error: distance of each person "
        "to the estimate that is his in the assignment of least total distance, or to the only "
        f"one; from step {SETTLING} on. Frames a second of stage 1 without reading the pictures.",
        f"As published, those who share a measurement take its place: the middle of two who touch "
        f"is up to {middle:.1f} px from either here, whatever the filter does.",
    ]
    clip_figures = {name: _figures(values, seeds) for name, values in measured.items()}
    recorded = _recording(context, notes)
    return Result(
        head=("filter", ">mean error (px)", ">largest (px)", ">largest, median clip (px)",
              ">ids changed, a clip", ">frames/s", ">recording: heads found", ">error (px)"),
        rows=tuple(
            (
                name,
                *(number(figures[key], 2) for key in ("mean", "largest", "median_largest")),
                number(figures["switches"], 1),
                number(figures["frames_per_second"], 0),
                number(recorded.get(name, {}).get("found"), 3),
                number(recorded.get(name, {}).get("error"), 2),
            )
            for name, figures in clip_figures.items()
        ),
        numbers={
            "clips": clip_figures,
            "recording": recorded,
            "error_of_the_middle": middle,
            "steps": STEPS,
            "half_sizes": list(HALF_SIZES),
            "parameters": {name: changed_values(p) for name, p in methods().items()},
        },
        findings=_findings(clip_figures),
        figure=lambda: _draw(first, measured),
        notes=tuple(notes),
    )  # fmt: skip


def _follow(
    context: Context, sequence: Sequence, camera: int, parameters: RunParameters, steps: int
) -> tuple[list[ViewResult], float]:
    """The results of one camera's steps, and the seconds that they took by themselves."""
    results, seconds = [], 0.0
    with FrameReader(sequence) as reader:
        method = single_view.create(parameters.single_view, sequence, camera, parameters, reader)
        state = method.start()
        for step, picture in zip(range(steps), reader.iterate(camera), strict=False):
            if context.cancelled():
                raise Cancelled
            rng = np.random.default_rng(step)
            begin = time.perf_counter()
            state, result = method.step(state, step, picture, rng)
            seconds += time.perf_counter() - begin
            results.append(result)
    return results, seconds


def centre_errors(
    truth: Float[ndarray, "K A 2"], results: list[ViewResult]
) -> tuple[Float[ndarray, "K A"], int]:
    """Distance of each person to his estimate at each step, and how often its label changed.

    Estimates are given to people so that the total distance is least; where there are
    fewer than people, each person is measured to the nearest. NaN where there is none.
    """
    errors = np.full(truth.shape[:2], np.nan)
    labels: dict[int, int] = {}
    switches = 0
    for step, result in enumerate(results):
        apart = np.linalg.norm(truth[step][:, None] - result.estimates[None, :, :2], axis=2)
        if not apart.size:
            continue
        errors[step] = apart.min(axis=1)
        if apart.shape[1] < apart.shape[0]:
            continue
        people, chosen = linear_sum_assignment(apart)
        errors[step, people] = apart[people, chosen]
        for person, label in zip(people.tolist(), result.estimate_labels[chosen], strict=True):
            switches += labels.setdefault(person, int(label)) != label
            labels[person] = int(label)
    return errors, switches


def error_of_the_middle(scene: clips.Clip, results: list[ViewResult]) -> float:
    """How far the true middle of both is from either, at most, where one piece shows them."""
    largest = 0.0
    for step in range(SETTLING, len(results)):
        if len(results[step].measurements) != 1:
            continue
        boxes = Boxes(scene.boxes(step))
        whole = Boxes.from_corners(boxes.low.min(0), boxes.high.max(0))
        off = np.linalg.norm(boxes.centres - whole.centres, axis=1)
        largest = max(largest, float(off.max()))
    return largest


def _figures(values: dict[str, Any], seeds: int) -> dict[str, Any]:
    counted = np.array(values["errors"])[:, SETTLING:]
    # where there is not a single estimate nothing can be measured: it counts as a picture's width
    counted = np.where(np.isnan(counted), float(SIZE[0]), counted)
    largest = counted.max(axis=(1, 2))
    return {
        "mean": float(counted.mean()),
        "largest": float(largest.max()),
        "median_largest": float(np.median(largest)),
        "largest_by_clip": largest.tolist(),
        "switches": values["switches"] / seeds,
        "frames_per_second": seeds * STEPS / values["seconds"],
    }


def _recording(context: Context, notes: list[str]) -> dict[str, dict[str, float | None]]:
    """Heads found in each camera of the recording, and how far from where they are."""
    try:
        sequence = runs.recording(context, cameras.RECORDING)
    except Unavailable as missing:
        notes.append(f"Left out: {missing}.")
        return {}
    steps = min(QUICK_STEPS, sequence.frames) if context.quick else sequence.frames
    notes.append(
        f"{sequence.name}: heads found within one half size in {len(sequence.views)} cameras, "
        "all filters with a target under each top of the foreground."
    )
    found: dict[str, dict[str, float | None]] = {}
    for name, parameters in methods().items():
        heads = with_values(parameters, {"jpda.foreground_box": "target"})
        errors: list[float] = []
        total = 0
        for camera in range(len(sequence.views)):
            context.told(f"{name} in {sequence.name}", camera, len(sequence.views))
            results, _ = _follow(context, sequence, camera, heads, steps)
            near, there = _heads(sequence, camera, results)
            errors += near
            total += there
        found[name] = {
            "found": len(errors) / total if total else None,
            "error": float(np.mean(errors)) if errors else None,
        }
    return found


def _heads(sequence: Sequence, camera: int, results: list[ViewResult]) -> tuple[list[float], int]:
    """Distances, in pixels, of the heads that were found, and how many there are."""
    truth = sequence.ground_truth
    assert truth is not None
    errors, total = [], 0
    for step, result in enumerate(results):
        rows = truth.at(step)
        certain = truth.positions[rows][truth.valid[rows]]
        boxes, seen = upright_boxes(sequence.cameras[camera], certain, sequence.target_half_extents)
        total += int(seen.sum())
        offsets = boxes[seen][:, None, :2] - result.boxes[None, :, :2]
        relative = np.abs(offsets / boxes[seen][:, None, 2:]).max(axis=2)
        people, chosen = assign(relative, 1.0)
        errors += np.linalg.norm(offsets[people, chosen], axis=1).tolist()
    return errors, total


def _findings(figures: dict[str, dict[str, Any]]) -> tuple[Finding, ...]:
    findings = []
    for name in (PUBLISHED, DEFAULTS):
        largest = figures[name]["largest"]
        findings.append(
            Finding(
                f"the largest error is under {LARGEST_ERROR:g} px ({name})",
                f"{largest:.1f} px, in the median clip {figures[name]['median_largest']:.1f} px; "
                f"mean {figures[name]['mean']:.1f} px",
                "better" if largest < LARGEST_ERROR else "worse",
            )
        )
    times = figures[CLASSICAL]["largest"] / figures[PUBLISHED]["largest"]
    speed = figures[PUBLISHED]["frames_per_second"]
    return (
        *findings,
        Finding(
            "the classical filter errs far more",
            f"its largest error is {figures[CLASSICAL]['largest']:.0f} px, {times:.1f} times that "
            f"of the five cases as published; mean {figures[CLASSICAL]['mean']:.1f} px",
            "better" if times >= FAR_MORE else "worse",
        ),
        Finding(
            f"about {FRAMES_A_SECOND:g} frames a second",
            f"{speed:.0f} frames/s as published, the foreground included",
            "better" if speed >= FRAMES_A_SECOND else "worse",
        ),
    )


def _draw(first: dict[str, list[ViewResult]], measured: dict[str, dict[str, Any]]) -> Figure:
    from tests.papers.laboratory import drawing

    scene, moments = clip(0), (30, 120, 160, 215)
    figure = drawing.sheet(11.0, 6.2, "Two who look alike: centre errors and estimates, first clip")
    axes = drawing.panels(
        figure, [["error"] * len(moments), [f"{m}" for m in moments]], height_ratios=[1.0, 1.1]
    )
    for index, (name, values) in enumerate(measured.items()):
        axes["error"].plot(values["errors"][0].max(axis=1), color=drawing.colour(index + 1),
                           label=name)  # fmt: skip
    axes["error"].axhline(LARGEST_ERROR, color=drawing.MUTED, linewidth=0.8, linestyle="--")
    axes["error"].set(yscale="log", ylim=(0.3, None), xlim=(SETTLING, STEPS),
                      ylabel="larger error of the two (px)")  # fmt: skip
    axes["error"].legend(loc="upper left", ncols=3)
    for moment in moments:
        plot = axes[f"{moment}"]
        plot.imshow(cv2.cvtColor(scene.picture(moment), cv2.COLOR_BGR2RGB))
        x, y = np.nanmean(scene.boxes(moment)[:, :2], axis=0)
        plot.set(xlim=(x - 90, x + 90), ylim=(y + 60, y - 60), xticks=[], yticks=[])
        plot.grid(visible=False)
        plot.set_title(f"k = {moment}", fontsize=8.5)
        for index, results in enumerate(first.values()):
            for box in Boxes(results[moment].estimates).left_top.tolist():
                drawing.box(plot, box, drawing.colour(index + 1))
    return figure


EXPERIMENT = Experiment("jpda", CLAIM, run)

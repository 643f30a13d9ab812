"""Figure 2: the tracks reprojected into both cameras where people appear and hide each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tests.papers.claims.fig1 import QUICK_STEPS, ROOM
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result
from tests.rooms import read_visibility
from tracker.evaluation.figures import number
from tracker.evaluation.matching import assign
from tracker.geometry.boxes import box_overlaps
from tracker.runs.pipeline import Run
from tracker.sequences.pictures.frames import FrameReader

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS = {
    99: "1 appears",
    144: "2 appears",
    247: "3 appears",
    264: "2 hides 3, both cameras",
    295: "2 hides 3, both cameras",
    809: "1 hides 3, 2 hides 1",
}
"""The steps of the paper and what happens there."""

OVERLAP = 0.5
"""Intersection over union from which a box is the person's."""

CLAIM = (
    "Reprojected into both cameras, every track's box lies on its person, also where people "
    "appear (k = 99, 144, 247) and hide each other (k = 264, 295, 809)."
)


def run(context: Context) -> Result:
    """Set the reprojected boxes against the true ones at those steps."""
    sequence = runs.room(context, ROOM, QUICK_STEPS if context.quick else None)
    tracked = runs.computed(context, sequence).run
    visible = read_visibility(sequence.folder)
    rows: list[tuple[str, ...]] = []
    pictures: list[dict[str, Any]] = []
    for step, words in STEPS.items():
        if step >= sequence.frames:
            continue
        for camera in range(len(sequence.views)):
            people = _overlaps(tracked, step, camera, visible)
            pictures.append({"step": step, "camera": sequence.cameras[camera].name,
                             "what": words, "people": people})  # fmt: skip
            rows.append(
                (
                    f"{step}",
                    sequence.cameras[camera].name,
                    *(
                        "–" if name not in people
                        else f"{number(people[name]['overlap'], 2)} "
                        f"({100.0 * people[name]['visible']:.0f} %)"
                        for name in ("1", "2", "3")
                    ),
                    words,
                )
            )  # fmt: skip
    shares = [person["overlap"] for p in pictures for person in p["people"].values()]
    found = sum(share is not None for share in shares)
    hidden = [
        person["overlap"] for p in pictures for person in p["people"].values()
        if person["visible"] < 0.5
    ]  # fmt: skip
    mean = float(np.mean([s for s in shares if s is not None])) if found else None
    return Result(
        head=("k", "camera", ">person 1", ">person 2", ">person 3", "what happens"),
        rows=tuple(rows),
        numbers={"room": ROOM, "overlap": OVERLAP, "mean_overlap": mean, "pictures": pictures},
        findings=(
            Finding(
                "every box lies on its person",
                f"{found} of {len(shares)} people have a box (IoU ≥ {OVERLAP:g}), mean IoU "
                f"{number(mean, 2)}; of the {len(hidden)} more than half hidden, "
                f"{sum(h is not None for h in hidden)} have one",
                "better" if found == len(shares) else "worse",
            ),
        ),
        figure=lambda: _draw(tracked),
        notes=(
            "Overlap (IoU) of the track's box with the true one, and how much of the person the "
            "camera sees.",
        ),
    )


def _overlaps(run: Run, step: int, camera: int, visible: np.ndarray) -> dict[str, Any]:
    """For each person there, the overlap with his box (None: no box) and his visible share."""
    sequence, truth = run.sequence, run.sequence.ground_truth
    assert truth is not None
    view, half = sequence.cameras[camera], sequence.target_half_extents
    here = truth.at(step)
    people = truth.ids[here]
    wanted, in_picture = view.project_boxes(truth.positions[here], half)
    boxes, shown = view.project_boxes(run.filtered.positions[run.filtered.at(step)], half)
    shared = box_overlaps(wanted[in_picture], boxes[shown])
    rows, columns = assign(1.0 - shared, 1.0 - OVERLAP)
    values = dict(zip(rows.tolist(), shared[rows, columns].tolist(), strict=True))
    return {
        str(person): {
            "overlap": values.get(index),
            "visible": float(visible[step, person - 1, camera]),
        }
        for index, person in enumerate(people[in_picture].tolist())
    }


def _draw(run: Run) -> Figure:
    from tests.papers.laboratory import drawing

    sequence, half = run.sequence, run.sequence.target_half_extents
    truth = sequence.ground_truth
    assert truth is not None
    steps = [step for step in STEPS if step < sequence.frames]
    cameras = sequence.cameras
    layout = [[f"{step} {camera.name}" for step in steps] for camera in cameras]
    figure = drawing.sheet(
        2.55 * len(steps), 2.12 * len(cameras) + 0.4,
        f"Tracks of {sequence.name} in both cameras (boxes with ids; truth dashed)",
    )  # fmt: skip
    axes = drawing.panels(figure, layout)
    with FrameReader(sequence) as reader:
        for index, camera in enumerate(cameras):
            for step in steps:
                plot = axes[f"{step} {camera.name}"]
                picture = reader.picture(index, step)
                width, height = camera.image_size
                if picture is not None:
                    plot.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), interpolation="lanczos")
                plot.set(xlim=(0, width), ylim=(height, 0), xticks=[], yticks=[])
                plot.grid(visible=False)
                for place in camera.project_boxes(truth.positions[truth.at(step)], half)[0]:
                    drawing.box(plot, tuple(place.tolist()), "#ffffff", dashed=True)
                rows = run.filtered.at(step)
                boxes, visible = camera.project_boxes(run.filtered.positions[rows], half)
                for name, place, shown in zip(
                    run.filtered.ids[rows].tolist(), boxes.tolist(), visible.tolist(), strict=True
                ):
                    if shown:
                        drawing.box(plot, tuple(place), drawing.picture_colour(name))
                        drawing.tag(plot, place[0], place[1], name)
                if index == 0:
                    plot.set_title(f"k = {step}: {STEPS[step]}", fontsize=8.5)
                if step == steps[0]:
                    plot.set_ylabel(camera.name)
    return figure


EXPERIMENT = Experiment("fig2", CLAIM, run)

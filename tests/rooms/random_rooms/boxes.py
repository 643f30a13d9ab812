"""True boxes of a random room, templates cut from them, and what a detector would make of them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.rooms.random_rooms.choices import Choices
from tests.rooms.writing import Marked
from tracker.geometry.boxes import box_overlaps
from tracker.geometry.camera import Camera

FILE = "boxes.csv"
_FOUND = 0.3
"""Visible share from which a detector usually finds a person."""
_SURE = 0.25
"""Share of a person that some camera must see for its position to be certain."""
_CLEAR = 0.9
"""Visible share of who is marked as a template, where there is such a picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the cameras see of the people."""

    boxes: Float[ndarray, "F P C 4"]
    """Left, top, width, height in pixels, cut at the picture's border; NaN where nothing is in
    the picture."""
    visible: Float[ndarray, "F P C"]
    """Share of what is tracked that the camera sees."""
    framed: Float[ndarray, "F P C"]
    """Share of the whole box that lies in the picture."""


def seen_by(
    cameras: Sequence[Camera], corners: Float[ndarray, "F P C 4"],
    visible: Float[ndarray, "F P C"],
) -> Seen:  # fmt: skip
    """Boxes in the pictures of the cameras, from uncut corners in their pixels."""
    boxes = np.full(corners.shape, np.nan)
    framed = np.zeros(corners.shape[:3])
    for number, camera in enumerate(cameras):
        own = corners[:, :, number]
        limit = np.array(camera.image_size) - 0.5
        low, high = np.clip(own[..., :2], -0.5, limit), np.clip(own[..., 2:], -0.5, limit)
        with np.errstate(invalid="ignore"):
            there = ((high - low) > 0.5).all(axis=2)
            whole = np.prod(own[..., 2:] - own[..., :2], axis=2)
            framed[:, :, number] = np.where(there, np.prod(high - low, axis=2) / whole, 0.0)
        boxes[:, :, number, :2] = np.where(there[..., None], low, np.nan)
        boxes[:, :, number, 2:] = np.where(there[..., None], high - low, np.nan)
    return Seen(boxes, visible, framed)


def certain(seen: Seen) -> Bool[ndarray, "F P"]:
    """Whether a position can be known: two cameras look there, and one sees the person."""
    looked = (seen.framed >= 0.5).sum(axis=2) >= 2
    return np.asarray(looked & (seen.visible.max(axis=2) >= _SURE))


def write_boxes(path: Path, names: Sequence[str], seen: Seen) -> None:
    """One row for each person in each picture: frame, id, camera, box, visible share."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "id", "camera", "left", "top", "width", "height", "visible"])
        for step, person, camera in np.argwhere(np.isfinite(seen.boxes[..., 0])):
            box = [f"{value:.2f}" for value in seen.boxes[step, person, camera]]
            share = f"{seen.visible[step, person, camera]:.3f}"
            rows.writerow([step, person + 1, names[camera], *box, share])


def mark(choices: Choices, names: Sequence[str], inside: ndarray, seen: Seen) -> list[Marked]:
    """Templates as somebody would mark them: clear and large, in one camera or in several.

    Args:
        choices: How many of each person.
        names: Of the cameras.
        inside: (F, P), who is in the room when.
        seen: The true boxes.
    """
    chosen = []
    for person in range(choices.people):
        shares = np.where(inside[:, person, None], seen.visible[:, person], 0.0)
        heights = np.nan_to_num(seen.boxes[:, person, :, 3])
        whole = seen.framed[:, person] > 0.999
        worth = np.where(whole, np.minimum(shares / _CLEAR, 1.0), 0.0) ** 4 * heights
        order = np.argsort(-worth.max(axis=0))
        for camera in order[: choices.templates]:
            step = int(np.argmax(worth[:, camera]))
            if shares[step, camera] < 0.5 or worth[step, camera] <= 0.0:
                continue
            box = np.round(seen.boxes[step, person, camera], 1)
            chosen.append(Marked(f"person{person + 1}", names[camera], step, box))
    return chosen


def write_detections(path: Path, choices: Choices, number: int, camera: Camera, seen: Seen) -> None:
    """What a good detector would find in one camera: shifted, missed and false boxes, scores.

    A person of whom less is visible is found less often, two boxes that cover each other
    by most become one, and false boxes are as large as true ones and stay for some steps.
    """
    rng = np.random.default_rng([21, choices.seed, number])
    boxes, shares = seen.boxes[:, :, number], seen.visible[:, :, number]
    sizes = boxes[np.isfinite(boxes[..., 0])][:, 2:]
    rows: list[tuple[int, ndarray, float]] = []
    false: list[tuple[int, ndarray]] = []
    for step in range(len(boxes)):
        kept: list[ndarray] = []
        for person in np.argsort(-np.nan_to_num(shares[step])):
            box, share = boxes[step, person], shares[step, person]
            likely = 0.97 * np.clip((share - 0.1) / (_FOUND - 0.1), 0.0, 1.0)
            if not np.isfinite(box).all() or rng.random() > likely:
                continue
            if any(box_overlaps(box[None], other[None])[0, 0] > 0.7 for other in kept):
                continue
            kept.append(box)
            noisy = box + rng.normal(0.0, 0.03, 4) * np.tile(box[2:], 2)
            rows.append((step, noisy, float(np.clip(rng.normal(0.55 + 0.4 * share, 0.07), 0.1, 1))))
        false = [(left - 1, box) for left, box in false if left > 1]
        if len(sizes) and rng.random() < 0.02:
            size = sizes[int(rng.integers(len(sizes)))]
            place = rng.uniform(0.0, 1.0, 2) * np.maximum(np.array(camera.image_size) - size, 1.0)
            false.append((int(rng.integers(1, 12)), np.concatenate([place, size])))
        rows += [(step, box, float(rng.uniform(0.25, 0.6))) for _, box in false]
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["frame", "left", "top", "width", "height", "score"])
        for step, box, score in rows:
            table.writerow([step, *(f"{value:.1f}" for value in box), f"{score:.3f}"])

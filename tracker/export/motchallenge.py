"""MOTChallenge text in TrackEval's folders: a file for each camera, and one for the ground plane.

A row is ``frame, id, left, top, width, height, confidence, -1, -1, -1`` as in results of the 2D
challenge; frames and ids start at 1. In a camera's file the box is the reprojected one in pixels,
which also start at 1 [MOT16, sec. 4.2]; in the file of the ground plane it is the target's outline
on the floor in metres, and the last column is z. There are no other positions: TrackEval reads the
eighth column as the class, and py-motmetrics refuses more than ten. A person of the truth with an
uncertain position (``valid = 0``) is written as a distractor: a track that matches it counts
neither as correct nor as false.

[MOT16] Milan, Leal-Taixé, Reid, Roth, Schindler, "MOT16: a benchmark for multi-object
tracking", arXiv 1603.00831, 2016. Folders: TrackEval, docs/MOTChallenge-Official/Readme.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.export.exported_run import ExportedRun, Options
from tracker.files.atomic import file_names
from tracker.io.read.detections.motchallenge import GROUND_PLANE, TRACKEVAL

BENCHMARK, SPLIT, TRACKER = "multiview", "train", "multiview-phd"
"""The names of the benchmark, of its part and of the tracker in TrackEval's folders."""

PERSON, DISTRACTOR = 1, 8
"""The class numbers of the challenge for people, and for people whose position is uncertain."""

_FROM_1 = np.array([1.0, 1.0, 0.0, 0.0])
"""Addend to left, top, width, height, so that pixels start at 1."""

_CLOSE = 10
"""Number of decimals of coordinates, so that metrics agree to about the precision of a double."""


def write(folder: Path, run: ExportedRun, options: Options) -> None:
    """Write a run into a folder: ``gt`` (if there is ground truth) and ``trackers``."""
    sequence, tracks = run.sequence, run.tracks
    name = "".join(c if c.isalnum() or c in "-_" else "-" for c in sequence.name)
    half = sequence.target_half_extents
    truth = sequence.ground_truth
    names = file_names([GROUND_PLANE, *(camera.name for camera in sequence.cameras)])
    parts = [(part, k - 1) for k, part in enumerate(names)]
    for done, (part, index) in enumerate(parts):
        options.at(done, len(parts))
        one = f"{name}-{part}"
        if index < 0:
            boxes, visible = _outlines(tracks.positions, half), np.ones(len(tracks), dtype=bool)
        else:
            boxes, visible = run.boxes[index]
            boxes = boxes + _FROM_1
        last = _numbers(tracks.positions[:, 2].tolist()) if index < 0 else ["-1"] * len(tracks)
        rows = _rows(tracks.frames, tracks.ids, boxes, np.minimum(tracks.existences, 1.0), last)
        results = folder / "trackers" / TRACKEVAL / f"{BENCHMARK}-{SPLIT}" / TRACKER / "data"
        _save(results / f"{one}.txt", _chosen(rows, visible))
        if truth is None:
            continue
        home = folder / "gt" / TRACKEVAL / f"{BENCHMARK}-{SPLIT}" / one
        if index < 0:
            boxes, visible = _outlines(truth.positions, half), np.ones(len(truth.ids), dtype=bool)
        else:
            camera = sequence.cameras[index]
            boxes, visible = camera.project_boxes(truth.positions, half)
            boxes = boxes + _FROM_1
        visible = visible & (truth.frames < run.steps)
        kinds = np.where(truth.valid, PERSON, DISTRACTOR)
        numbers = np.unique(truth.ids, return_inverse=True)[1] + 1
        _save(
            home / "gt" / "gt.txt",
            _chosen(
                _truth_rows(truth.frames, numbers, boxes, truth.valid.astype(int), kinds), visible
            ),
        )
        width, height = (100, 100) if index < 0 else sequence.cameras[index].image_size
        _save(
            home / "seqinfo.ini",
            [
                f"[Sequence]\nname={one}\nimDir=img1\nframeRate={sequence.fps:g}\n"
                f"seqLength={run.steps}\nimWidth={width}\nimHeight={height}\nimExt=.jpg\n"
            ],
        )
    if truth is not None:
        maps = folder / "gt" / TRACKEVAL / "seqmaps" / f"{BENCHMARK}-{SPLIT}.txt"
        _save(maps, ["name\n", *(f"{name}-{part}\n" for part, _ in parts)])
    options.at(len(parts), len(parts))


def _outlines(
    positions: Float[ndarray, "N 3"], half: Float[ndarray, " 3"]
) -> Float[ndarray, "N 4"]:
    low = positions[:, :2] - half[:2]
    return np.concatenate([low, np.broadcast_to(2.0 * half[:2], low.shape)], axis=1)


def _rows(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    boxes: Float[ndarray, "N 4"],
    confidences: Float[ndarray, " N"],
    last: list[str],
) -> list[str]:
    """Return rows as in the module's description, with the values of their last column."""
    columns = (frames.tolist(), ids.tolist(), boxes.tolist(), confidences.tolist(), last)
    return [
        f"{frame + 1},{number},{','.join(_numbers(box))},{confidence:.6f},-1,-1,{end}\n"
        for frame, number, box, confidence, end in zip(*columns, strict=True)
    ]


def _truth_rows(
    frames: Int[ndarray, " G"],
    ids: Int[ndarray, " G"],
    boxes: Float[ndarray, "G 4"],
    counted: Int[ndarray, " G"],
    kinds: Int[ndarray, " G"],
) -> list[str]:
    """Return rows of ``frame, id, left, top, width, height, counted, class, visibility``."""
    columns = (frames.tolist(), ids.tolist(), boxes.tolist(), counted.tolist(), kinds.tolist())
    return [
        f"{frame + 1},{number},{','.join(_numbers(box))},{counts},{kind},1\n"
        for frame, number, box, counts, kind in zip(*columns, strict=True)
    ]


def _numbers(values: list[float]) -> list[str]:
    return [f"{value:.{_CLOSE}f}" for value in values]


def _chosen(rows: list[str], mask: ndarray) -> Iterable[str]:
    return (rows[k] for k in np.flatnonzero(mask).tolist())


def _save(path: Path, lines: Iterable[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(lines)

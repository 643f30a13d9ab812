"""Windows of random rooms with what is in them: a person, nobody, or what says neither."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy import ndarray

from tests.rooms.random_rooms.figures import HALF_EXTENTS
from tracker.kernels.pictures.channels import cell_means
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures.foreground import learn_background
from tracker.single_view.rectification.sequence import RectifiedSequence
from tracker.single_view.shape.channels import Channels
from tracker.single_view.shape.finder import PIXELS_PER_METRE, Trees, Windows

CAMERAS, STEPS = 3, 9
"""Looked at in each room, at most."""

RATE = 16.0
"""Pictures a second that motion is followed over, at least."""

PERSON, NOBODY, EITHER = 1, 0, -1

_PLACE, _SIZE = 0.1, 0.2
"""A window on a person lies within so many widths and logarithms of size of the true one."""

_NEAR, _ALIKE = 0.4, 0.7
"""One within these says neither."""

_SEEN = 0.5
"""Share of a person that must be visible."""

_PEOPLE, _OTHERS, _HARD, _BESIDE = 20, 70, 60, 25
"""Windows of a picture: on people; on nobody in the first round; in the second one those that
were hardest to tell, and others beside them."""


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody at one step."""

    number: int
    crown: ndarray
    lies: bool


def people_of(folder: Path) -> dict[int, list[Person]]:
    """Where the crowns of all people in a room are, by step."""
    labels = json.loads((folder / "labels.json").read_text(encoding="utf-8"))
    trunk = labels["target"] == "head and torso"
    height = HALF_EXTENTS["head and torso"][2]
    found: dict[int, list[Person]] = {}
    with (folder / "ground_truth.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            x, y, z = (float(row[axis]) for axis in "xyz")
            number = int(row["id"])
            crown = np.array([x, y, z + height if trunk else 2.0 * z])
            lies = labels["behaviours"][number - 1] == "lies"
            found.setdefault(int(row["frame"]), []).append(Person(number, crown, lies))
    return found


def visible_of(folder: Path) -> dict[tuple[str, int, int], float]:
    """The visible share of each person by camera, step and number."""
    with (folder / "boxes.csv").open(encoding="utf-8") as file:
        return {
            (row["camera"], int(row["frame"]), int(row["id"])): float(row["visible"])
            for row in csv.DictReader(file)
        }


def labels_of(windows: Windows, truth: Windows, lies: ndarray, visible: ndarray) -> ndarray:
    """What each of N windows shows, by the true windows of P people."""
    labels = np.full(len(windows.edges), NOBODY)
    middles = (windows.edges[:, :2] + windows.edges[:, 2:]) / 2.0
    for edges, lying, share in zip(truth.edges, lies, visible, strict=True):
        if not np.isfinite(edges).all():
            continue
        span = edges[2:] - edges[:2]
        apart = np.abs(middles - (edges[:2] + edges[2:]) / 2.0) / span
        top = np.abs(windows.edges[:, 1] - edges[1]) / span[1]
        size = np.abs(np.log((windows.edges[:, 2:] - windows.edges[:, :2]) / span)).max(axis=1)
        near = (apart < 1.0).all(axis=1) if lying else (apart < _NEAR).all(axis=1)
        near &= lying | (size < _ALIKE)
        labels[near & (labels == NOBODY)] = EITHER
        on = (apart < _PLACE).all(axis=1) & (top < _PLACE) & (size < _SIZE)
        if share > _SEEN and not lying:
            labels[on] = PERSON
    return labels


def of_room(folder: Path, trees: Trees | None) -> tuple[ndarray, ndarray]:
    """Means of the channels' cells (N, features), and whether there is a person (N,).

    Args:
        folder: Of a random room.
        trees: Of the round before, None in the first.
    """
    sequence, rng = read_sequence(folder), np.random.default_rng(int(folder.name))
    chosen = with_values(RunParameters(), {"single_view": "shapes"})
    rectified = RectifiedSequence.of(sequence, chosen, FrameReader(sequence))
    people, visible = people_of(folder), visible_of(folder)
    means, labels = [], []
    for number, camera in enumerate(rectified.sequence.cameras[:CAMERAS]):
        windows = Windows.of(camera, sequence.room, sequence.target_half_extents)
        background = learn_background(rectified.sequence, number, rectified.reader)
        if background is None or not len(windows.edges):
            continue
        size = float(np.median(windows.sizes))
        factor = min(1.0, PIXELS_PER_METRE / size)
        channels = Channels(background, factor, size * factor, sequence.step_time)
        edges = (windows.edges + 0.5) * np.tile(channels.factors, 2) - 0.5
        state = channels.initial()
        for step, sampled in _steps(sequence):
            picture = rectified.reader.picture(number, step)
            if picture is None:
                continue
            state, sums = channels.step(state, picture)
            if not sampled:
                continue
            there = people.get(step, [])
            crowns = np.array([one.crown for one in there]).reshape(-1, 3)
            truth, _ = Windows.at(camera, crowns, sequence.target_half_extents)
            lies = np.array([one.lies for one in there], dtype=bool)
            shares = np.array([visible.get((camera.name, step, p.number), 0.0) for p in there])
            found = labels_of(windows, truth, lies, shares)
            taken = _taken(found, trees, sums, edges, rng)
            means.append(cell_means(sums, edges[taken]))
            labels.append(found[taken] == PERSON)
    return np.concatenate(means), np.concatenate(labels)


def _steps(sequence: Sequence) -> list[tuple[int, bool]]:
    """The steps that are looked at, and of which windows are taken."""
    every = max(1, int(sequence.fps / RATE))
    sampled = set(np.linspace(2, sequence.frames - 1, STEPS).astype(int).tolist())
    seen = sorted(sampled | set(range(0, sequence.frames, every)))
    return [(step, step in sampled) for step in seen]


def _taken(
    labels: ndarray, trees: Trees | None, sums: ndarray, edges: ndarray, rng: np.random.Generator
) -> ndarray:
    def some(indices: ndarray, most: int) -> ndarray:
        return rng.choice(indices, most, replace=False) if len(indices) > most else indices

    people, others = np.flatnonzero(labels == PERSON), np.flatnonzero(labels == NOBODY)
    if trees is None:
        return np.concatenate([some(people, _PEOPLE), some(others, _OTHERS)])
    scores = trees.scores(sums, edges[others])
    order = np.argsort(-scores)
    order = order[np.isfinite(scores[order])]
    hard = np.concatenate([order[: _HARD // 3], some(order[_HARD // 3 :], 2 * _HARD // 3)])
    return np.concatenate([some(people, _PEOPLE), others[hard], some(others, _BESIDE)])

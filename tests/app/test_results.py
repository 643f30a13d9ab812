"""What a camera's method tells besides boxes reaches the page as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from app.results import step_of
from tracker import pipeline
from tracker.sequences.reader import read_sequence
from tracker.single_view.protocol import ViewEvent


def test_events_and_gates_of_a_camera_are_in_its_step(crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence), steps=6)
    plain, *others = run.views[5]
    gates = np.array([[40.0, 50.25, 9.0, -1.5, 4.004]])
    told = (ViewEvent("occluded", (3, 5)), ViewEvent("new", (7,)))
    run.views[5] = (replace(plain, events=told, gates=gates), *others)
    first, *rest = step_of(sequence, run, 5).cameras
    assert [(event.kind, event.labels) for event in first.events] == [
        ("occluded", [3, 5]),
        ("new", [7]),
    ]
    assert first.gates == [(40.0, 50.25, 9.0, -1.5, 4.0)]
    assert all(camera.events == [] and camera.gates == [] for camera in rest)

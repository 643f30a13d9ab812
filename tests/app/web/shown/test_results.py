"""One step as the page gets it: what the methods found, why, and how far from the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.web.steps import step_of
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence
from tracker.single_view.protocol import ViewEvent


def test_events_and_gates_of_a_camera_are_in_its_step(crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence), steps=6)
    plain, *others = run.views[5]
    gates = np.array([[40.0, 50.25, 9.0, -1.5, 4.004]])
    told = (ViewEvent("occluded", (3, 5)), ViewEvent("new", (7,)))
    last = (replace(plain, events=told, gates=gates), *others)
    run.views = run.views.alike([*run.views[:5], last])
    first, *rest = step_of(sequence, run, 5).cameras
    assert [(event.kind, event.labels) for event in first.events] == [
        ("occluded", [3, 5]),
        ("new", [7]),
    ]
    assert first.gates == [(40.0, 50.25, 9.0, -1.5, 4.0)]
    assert all(camera.events == [] and camera.gates == [] for camera in rest)


def test_what_fed_a_track_and_why_a_camera_hardly_sees_it(crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    nominal = run.parameters.fusion.detection_probability
    reasons = set()
    for step in range(0, run.done, 3):
        message = step_of(sequence, run, step)
        for camera, view in zip(message.cameras, run.views[step], strict=True):
            for track in camera.tracks:
                reasons.add(track.reason)
                assert (track.fed_by is not None) == (track.source >= 0)
                if track.fed_by is not None:
                    x, y, half_width, half_height = view.boxes[track.source]
                    box = (x - half_width, y - half_height, 2 * half_width, 2 * half_height)
                    assert track.fed_by.box == pytest.approx(box, abs=0.01)
                    assert 0.0 <= track.fed_by.share <= 1.0
                if track.visible and track.detection_probability < 0.9 * nominal:
                    assert track.hidden_by is not None or track.reason == "near the edge"
    assert None in reasons


def test_each_person_is_told_the_track_that_is_his(crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    message = step_of(sequence, run, 60)
    assert len(message.truth) == 2
    places = {track.id: np.array(track.position) for track in message.tracks}
    for person in message.truth:
        assert person.track is not None
        apart = np.linalg.norm(places[person.track] - person.position)
        assert person.error == pytest.approx(apart, abs=1e-3)
    before = step_of(sequence, None, 60).truth
    assert [(p.track, p.error) for p in before] == [(None, None)] * 2


def test_trails_in_the_pictures_are_the_feet_of_the_tracks(crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    assert all(not t.trail for c in step_of(sequence, run, 60).cameras for t in c.tracks)
    message = step_of(sequence, run, 60, trails=4.0)
    found = 0
    for camera, view in zip(message.cameras, sequence.views, strict=True):
        for track in camera.tracks:
            for ahead, x, y in track.trail:
                found += 1
                rows = run.tracks.take(run.tracks.frames == 60 + ahead)
                foot = rows.positions[rows.ids == track.id] - [
                    0,
                    0,
                    sequence.target_half_extents[2],
                ]
                pixels, _ = view.camera.project(foot)
                assert (x, y) == pytest.approx(tuple(pixels[0]), abs=0.06)
    assert found > 20

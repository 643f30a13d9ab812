"""What can be plotted of a track, against the run's own numbers."""

from __future__ import annotations

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.web.courses import KINDS, courses_of
from app.web.timeline import Window
from tests.engine.synthetic import crossing, sequence
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline

STEPS = 40


@pytest.fixture(scope="module")
def run() -> pipeline.Run:
    return pipeline.compute(sequence(crossing(STEPS), STEPS), RunParameters(single_view="none"))


def test_each_course_is_the_tracks_own(run: pipeline.Run) -> None:
    told = courses_of(run, None, 1, list(KINDS), Window.of(STEPS))
    courses = {course.name: course for course in told.courses}
    tracks = run.tracks
    rows = np.flatnonzero(tracks.ids == 1)
    frames = tracks.frames[rows]

    def of(name: str, curve: int = 0) -> np.ndarray:
        values = courses[name].values[curve]
        assert len(values) == STEPS
        return np.array([values[frame] for frame in frames], dtype=float)

    np.testing.assert_allclose(of("existence"), tracks.existences[rows], atol=1e-4)
    np.testing.assert_allclose(
        of("height"), tracks.positions[rows, 2] - run.sequence.room.minimum[2], atol=1e-4
    )
    middle = len(rows) // 2
    reach = max(1, round(0.2 * run.sequence.fps))
    ends = tracks.positions[rows[[middle - reach, middle + reach]], :2]
    speed = np.linalg.norm(ends[1] - ends[0]) / (2 * reach / run.sequence.fps)
    assert of("speed")[middle] == pytest.approx(speed, abs=1e-3)
    cameras = len(run.sequence.views)
    assert len(courses["detection"].values) == len(courses["detection"].cameras) == cameras
    for camera in range(cameras):
        for k, value in enumerate(of("detection", camera)):
            component = tracks.components[rows[k]]
            if component >= 0:
                given = run.fused[frames[k]].detection_probabilities[camera, component]
                assert value == pytest.approx(given, abs=1e-4)
    for k, gap in enumerate(of("distance")):
        others = tracks.positions[tracks.at(frames[k])]
        gaps = np.sort(np.linalg.norm(others[:, :2] - tracks.positions[rows[k], :2], axis=1))
        assert np.isnan(gap) if len(gaps) < 2 else gap == pytest.approx(gaps[1], abs=1e-4)
    assert all(value is None for value in courses["error"].values[0])  # there is no truth


def test_a_bucket_is_the_mean_of_its_steps_and_a_part_is_cut_out(run: pipeline.Run) -> None:
    whole = courses_of(run, None, 1, ["height"], Window.of(STEPS)).courses[0].values[0]
    window = Window.of(STEPS, 10, 29, 5)
    part = courses_of(run, None, 1, ["height"], window)
    assert (part.first, part.stride) == (window.first, window.stride)
    values = part.courses[0].values[0]
    for k, value in enumerate(values):
        steps = range(window.first + k * window.stride, window.first + (k + 1) * window.stride)
        inside = [whole[s] for s in steps if s < window.end and whole[s] is not None]
        assert value == (pytest.approx(np.mean(inside), abs=1e-3) if inside else None)


def test_nobody_has_no_courses(run: pipeline.Run) -> None:
    assert courses_of(run, None, 999, list(KINDS), Window.of(STEPS)).courses == []


@pytest.mark.full
def test_the_error_is_that_of_the_evaluation(client: TestClient) -> None:
    told = client.get("/api/courses/1?kind=error&kind=nothing").json()
    assert [course["name"] for course in told["courses"]] == ["error"]
    series = client.get("/api/evaluation/series").json()
    (own,) = [error for error in series["track_errors"] if error["track"] == 1]
    values = told["courses"][0]["values"][0]
    for k, error in enumerate(own["values"]):
        value = values[own["first"] + k]
        assert value == (None if error is None else pytest.approx(error, abs=1e-3))

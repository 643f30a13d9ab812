"""Whose a detection is, and how far the nearest track is from one that is nobody's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.web.steps import step_of
from app.web.timeline import deviation
from tracker.filters.gaussian_mixture import gate_distance
from tracker.fusion.target_model import SIZES
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence
from tracker.steps import Steps


def changed(results: Steps[Any], step: int, result: Any) -> Steps[Any]:
    """The results of a stage, of one step another one."""
    return results.alike([*results[:step], result, *results[step + 1 :]])


def test_a_detection_is_the_tracks_that_it_feeds_and_any_other_one_is_nobodys(
    crossing: Path,
) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    step = 60
    before = step_of(sequence, run, step).cameras[0]
    fed = {track.fed_by.box: track.id for track in before.tracks if track.fed_by is not None}
    assert fed
    for detection in before.measurements:
        assert detection.track == fed.get(detection.box)
    # a false one far away from everybody
    view, *others = run.views[step]
    nobody = np.array([[5.0, 5.0, 3.0, 4.0]])
    more = replace(
        view,
        measurements=np.concatenate([view.measurements, nobody]),
        measurement_scores=np.append(view.measurement_scores, 0.4),
    )
    run.views = changed(run.views, step, (more, *others))
    last = step_of(sequence, run, step).cameras[0].measurements[-1]
    assert last.track is None
    assert last.nearest in {track.id for track in before.tracks}
    assert last.sigmas is not None
    assert last.sigmas > 4.0
    # in the measurement space of the fusion
    p = run.parameters.fusion
    gate = gate_distance(p.gate_probability, SIZES[p.measurement])
    assert last.gate == pytest.approx(gate**0.5, abs=0.01)
    assert last.sigmas > last.gate
    # one that lies where the track's box is expected is near
    there = next(track for track in before.tracks if track.box is not None)
    left, top, width, height = there.box or (0.0, 0.0, 1.0, 1.0)
    near = np.array([[left + width / 2, top + height / 2, width / 2, height / 2]])
    result = run.fused[step]
    sources = result.sources.copy()
    sources[0] = -1
    run.fused = changed(run.fused, step, replace(result, sources=sources))
    only_near = replace(view, measurements=near, measurement_scores=np.ones(1))
    run.views = changed(run.views, step, (only_near, *others))
    (only,) = step_of(sequence, run, step).cameras[0].measurements
    assert only.track is None
    assert only.nearest == there.id
    assert only.sigmas is not None
    assert only.sigmas < 2.5  # the bounds of a cuboid are not quite the box that a person has


@pytest.mark.parametrize(
    ("weights", "method", "sigma"),
    [
        ([], "multi_bernoulli", 0.0),
        ([1.0, 1.0], "multi_bernoulli", 0.0),
        ([0.5], "multi_bernoulli", 0.5),
        ([0.5, 0.5, 1.0], "multi_bernoulli", 0.5**0.5),
        ([1.5, 2.5], "sequential_phd", 2.0),
    ],
)
def test_the_number_of_people_is_as_uncertain_as_the_filter_says(
    weights: list[float], method: str, sigma: float
) -> None:
    assert deviation(np.array(weights), method) == pytest.approx(sigma)

"""OSPA and GOSPA against Stone Soup and against all permutations.

For orders above 1, Stone Soup assigns by the plain distances and raises the result
to the order afterwards, so its OSPA is not always the least; there it is an upper
bound, and trying every permutation is the reference.
"""

# mypy: disable-error-code="import-untyped"

from __future__ import annotations

from datetime import datetime
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.state import State

from tests.evaluation.scenes import comparison, distances, perturbed, point_sets, walks
from tracker.evaluation.ospa import gospa, gospa_parts, ospa, ospa_parts

NOW = datetime(2000, 1, 1)


def states(points: np.ndarray) -> list[State]:
    """One Stone Soup state a point."""
    return [State(point, timestamp=NOW) for point in points]


def by_permutations(apart: np.ndarray, cutoff: float, order: float) -> float:
    """OSPA from its definition."""
    if apart.shape[0] > apart.shape[1]:
        apart = apart.T
    smaller, larger = apart.shape
    if not larger:
        return 0.0
    costs = np.minimum(apart, cutoff) ** order
    best = min(
        sum(costs[i, column] for i, column in enumerate(chosen))
        for chosen in permutations(range(larger), smaller)
    )
    return float(((best + cutoff**order * (larger - smaller)) / larger) ** (1 / order))


@given(
    first=point_sets(),
    second=point_sets(),
    cutoff=st.sampled_from([0.5, 1.0, 3.0]),
    order=st.sampled_from([1.0, 2.0]),
)
def test_ospa(first: np.ndarray, second: np.ndarray, cutoff: float, order: float):
    apart = distances(first, second)
    ours = ospa_parts(apart, cutoff=cutoff, order=order)[0]
    assert ours == pytest.approx(by_permutations(apart, cutoff, order), abs=1e-9)
    if len(first) or len(second):
        metric = OSPAMetric(p=order, c=cutoff)
        theirs = metric.compute_OSPA_distance(states(second), states(first)).value
        if order == 1.0:
            assert ours == pytest.approx(theirs, abs=1e-9)
        else:
            assert ours <= theirs + 1e-9


@given(
    first=point_sets(),
    second=point_sets(),
    cutoff=st.sampled_from([0.5, 1.0, 3.0]),
    order=st.sampled_from([1.0, 2.0]),
)
def test_gospa(first: np.ndarray, second: np.ndarray, cutoff: float, order: float):
    near, missed, false = gospa_parts(distances(first, second), cutoff=cutoff, order=order)
    if len(first) or len(second):
        metric = GOSPAMetric(p=order, c=cutoff)
        theirs = metric.compute_gospa_metric(states(second), states(first))[0].value
        half = cutoff**order / 2
        assert near == pytest.approx(theirs["localisation"], abs=1e-9)
        assert half * missed == pytest.approx(theirs["missed"], abs=1e-9)
        assert half * false == pytest.approx(theirs["false"], abs=1e-9)
        total = (near + half * (missed + false)) ** (1 / order)
        assert total == pytest.approx(theirs["distance"], abs=1e-9)
    else:
        assert (near, missed, false) == (0.0, 0, 0)


def test_every_step_of_a_sequence_is_that_of_its_two_sets() -> None:
    truth = walks(3, people=5)
    tracks = perturbed(truth, 4, noise=0.25, missing=0.15, false=1.0)
    scene = comparison(truth, tracks)
    ours = ospa(scene, cutoff=0.5, order=1.0).distance
    costs = gospa(scene, cutoff=0.5, order=2.0).distance
    for step in range(0, scene.steps, 3):
        people = states(truth.positions[truth.at(step)])
        estimates = states(tracks.positions[tracks.frames == step])
        theirs = OSPAMetric(p=1, c=0.5).compute_OSPA_distance(estimates, people)
        assert ours[step] == pytest.approx(theirs.value, abs=1e-9)
        theirs = GOSPAMetric(p=2, c=0.5).compute_gospa_metric(estimates, people)[0]
        assert costs[step] == pytest.approx(theirs.value["distance"], abs=1e-9)

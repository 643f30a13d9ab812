"""From posteriors to tracks: one row a person a step, numbered as they appear."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import trajectories
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Bounds, Trajectories
from tracker.sequences.sequence import Room

CAMERAS = 3
COLUMNS = tuple(Trajectories.__slots__)


def posterior(
    weights: Iterable[float], labels: Iterable[int], *, dimension: int = 3
) -> FusionResult:
    """Component j stands at (j, 10 j, 100 j), is seen by camera j modulo 3."""
    w, ids = np.array(list(weights), dtype=float), np.array(list(labels), dtype=np.int64)
    size = len(w)
    means = np.zeros((size, dimension))
    means[:, :3] = np.arange(size)[:, None] * [1.0, 10.0, 100.0]
    variances = np.arange(1.0, dimension + 1.0) ** 2
    sources = np.full((CAMERAS, size), -1, dtype=np.int64)
    sources[np.arange(size) % CAMERAS, np.arange(size)] = 0
    return FusionResult(
        posterior=GaussianMixture(w, means, np.tile(np.diag(variances), (size, 1, 1)), ids),
        detection_probabilities=np.zeros((CAMERAS, size)),
        sources=sources,
        source_weights=np.zeros((CAMERAS, size)),
        hidden_by=np.full((CAMERAS, size), -1, dtype=np.int64),
    )


def extract(results: list[FusionResult], threshold: float = 0.5, **more: object) -> Trajectories:
    """As the pipeline does."""
    return trajectories.extract(
        results,
        cameras=CAMERAS,
        extraction_threshold=threshold,
        **more,  # type: ignore[arg-type]
    )


def assert_same(a: Trajectories, b: Trajectories) -> None:
    """Every column equal, type included."""
    for name in COLUMNS:
        assert_array_equal(getattr(a, name), getattr(b, name))
        assert getattr(a, name).dtype == getattr(b, name).dtype


def test_ids_count_from_one_in_the_order_of_appearance() -> None:
    tracks = extract(
        [
            posterior([0.2, 0.3], [5, 6]),
            posterior([0.9, 0.4], [70, 5]),
            posterior([0.8, 0.9, 0.7], [5, 70, 6]),
            posterior([0.1], [70]),
            posterior([0.9, 0.95], [70, 8]),
        ]
    )
    assert_array_equal(tracks.frames, [1, 2, 2, 2, 4, 4])
    assert_array_equal(tracks.ids, [1, 1, 2, 3, 1, 4])
    assert_array_equal(tracks.labels, [70, 70, 5, 6, 70, 8])
    assert_array_equal(tracks.existences, [0.9, 0.9, 0.8, 0.7, 0.9, 0.95])
    assert_array_equal(tracks.components, [0, 1, 0, 2, 0, 1])


def test_one_row_a_label_and_it_is_the_heaviest() -> None:
    tracks = extract([posterior([0.6, 0.9, 0.7, 0.9], [4, 4, 9, 4])])
    assert_array_equal(tracks.labels, [4, 9])
    assert_array_equal(tracks.existences, [0.9, 0.7])
    assert_array_equal(tracks.components, [1, 2])


def test_a_row_is_read_off_its_component() -> None:
    tracks = extract([posterior([0.6, 0.7], [4, 9], dimension=6)], first_frame=12)
    assert_array_equal(tracks.frames, [12, 12])
    assert_array_equal(tracks.positions, [[0.0, 0.0, 0.0], [1.0, 10.0, 100.0]])
    assert_array_equal(tracks.sigmas, [[1.0, 2.0, 3.0]] * 2)
    assert_array_equal(tracks.seen, [[True, False, False], [False, True, False]])


def test_the_threshold_itself_is_not_enough() -> None:
    assert len(extract([posterior([0.5], [1])])) == 0
    assert len(extract([posterior([0.5001], [1])])) == 1


def test_outside_the_room_nobody_is_reported() -> None:
    room = Room(np.array([0.5, 5.0, 50.0]), np.array([1.5, 15.0, 150.0]))
    results = [posterior([0.9, 0.9, 0.9], [1, 2, 3])]
    assert_array_equal(extract(results, bounds=Bounds(room, 0.1)).labels, [2])
    assert_array_equal(extract(results, bounds=Bounds(room, 50.0)).labels, [1, 2, 3])
    assert_array_equal(extract(results, bounds=Bounds(room)).labels, [1, 2, 3])


@st.composite
def runs(draw: st.DrawFn) -> list[FusionResult]:
    """Some steps with a few people who come and go."""
    steps = []
    for _ in range(draw(st.integers(0, 12))):
        labels = draw(st.lists(st.integers(1, 6), max_size=6))
        weights = [draw(st.sampled_from((0.1, 0.5, 0.6, 1.3))) for _ in labels]
        steps.append(posterior(weights, labels))
    return steps


@given(runs(), st.lists(st.integers(0, 12), max_size=3))
def test_pieces_give_the_same_as_the_whole(results: list[FusionResult], cuts: list[int]) -> None:
    whole = extract(results)
    edges = [0, *sorted(min(cut, len(results)) for cut in cuts), len(results)]
    ids: dict[int, int] = {}
    parts = [
        extract(results[first:last], first_frame=first, ids=ids)
        for first, last in itertools.pairwise(edges)
    ]
    assert_same(Trajectories.concatenate(parts), whole)


@given(runs())
def test_rows_are_sorted_and_each_person_is_there_once(results: list[FusionResult]) -> None:
    tracks = extract(results)
    keys = list(zip(tracks.frames.tolist(), tracks.ids.tolist(), strict=True))
    assert keys == sorted(set(keys))
    pairs = set(zip(tracks.ids.tolist(), tracks.labels.tolist(), strict=True))
    assert len(pairs) == len({i for i, _ in pairs}) == len({label for _, label in pairs})
    first_seen = [tracks.ids.tolist().index(i) for i in range(1, len(pairs) + 1)]
    assert first_seen == sorted(first_seen)
    for frame, result in enumerate(results):
        rows = tracks.at(frame)
        assert (tracks.frames[rows] == frame).all()
        heavy = result.posterior.weights > 0.5
        assert set(tracks.labels[rows]) == set(result.posterior.labels[heavy])


@pytest.mark.parametrize("results", [[], [posterior([], [])], [posterior([0.2], [1])] * 3])
def test_nobody(results: list[FusionResult]) -> None:
    tracks = extract(results)
    assert len(tracks) == 0
    assert tracks.seen.shape == (0, CAMERAS)
    assert_same(tracks, Trajectories.empty(CAMERAS))
    assert tracks.at(0) == slice(0, 0)


def boxed(weights: list[float], labels: list[int], sources: list[list[int]]) -> FusionResult:
    """The same components, fed by the given boxes of each camera."""
    plain = posterior(weights, labels)
    return FusionResult(
        plain.posterior,
        plain.detection_probabilities,
        np.array(sources, dtype=np.int64),
        plain.source_weights,
        plain.hidden_by,
    )


def test_components_of_one_box_count_together_where_asked() -> None:
    # the last camera's box 4 made two components, its box 2 one, and it missed the others
    result = boxed(
        [0.3, 0.4, 0.2, 0.3, 0.35, 0.6],
        [1, 2, 3, 4, 5, 6],
        [[0, 0, 0, 7, 7, -1], [1, 1, 1, 5, 5, -1], [4, 4, 2, -1, -1, -1]],
    )
    assert_array_equal(extract([result]).labels, [6])
    tracks = extract([result], rule="boxes")
    assert_array_equal(np.sort(tracks.labels), [2, 5, 6])
    row = int(np.flatnonzero(tracks.labels == 2)[0])
    assert tracks.existences[row] == pytest.approx(0.7)
    assert tracks.positions[row] == pytest.approx(np.array([1.0, 10.0, 100.0]) * 0.4 / 0.7)
    assert tracks.components[row] == 1, "the heaviest stands for them"
    spread = 1.0 + 0.3 / 0.7 * 0.4 / 0.7  # of a component, and between the two
    assert tracks.sigmas[row, 0] == pytest.approx(np.sqrt(spread))


def test_by_boxes_keeps_the_cardinality_and_the_mean() -> None:
    rng = np.random.default_rng(0)
    for size in (0, 1, 7, 20):
        result = boxed(
            rng.uniform(0.0, 0.6, size).tolist(),
            rng.integers(1, 9, size).tolist(),
            rng.integers(-1, 4, (CAMERAS, size)).tolist(),
        )
        if size == 0:
            result = boxed([], [], np.zeros((CAMERAS, 0)).tolist())
        gathered, leaders = trajectories.by_boxes(result)
        assert gathered.cardinality == pytest.approx(result.posterior.cardinality)
        assert len(leaders) == gathered.size <= size
        np.testing.assert_allclose(
            gathered.weights @ gathered.means,
            result.posterior.weights @ result.posterior.means,
        )


def test_without_boxes_both_rules_agree() -> None:
    result = boxed([0.7, 0.2, 0.9], [3, 4, 5], np.full((CAMERAS, 3), -1).tolist())
    assert_same(extract([result]), extract([result], rule="boxes"))


@given(runs())
def test_long_recordings_are_read_in_parts(results: list[FusionResult]) -> None:
    whole = extract(results, first_frame=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trajectories, "_AT_ONCE", 2)
        assert_same(extract(results, first_frame=3), whole)


def test_sigmas_and_the_covariance_on_the_ground_are_those_of_the_component() -> None:
    result = posterior([0.9, 0.8], [4, 9])
    spread = np.array([[4.0, 0.5, 0.1], [0.5, 9.0, 0.2], [0.1, 0.2, 16.0]])
    mixture = result.posterior
    covariances = np.stack([mixture.covariances[0], spread])
    tracks = extract([replace(result, posterior=replace(mixture, covariances=covariances))])
    assert_array_equal(tracks.covariances_xy, [0.0, 0.5])
    assert_array_equal(tracks.sigmas[1], [2.0, 3.0, 4.0])
    assert np.isnan(tracks.heights).all()
    assert np.isnan(tracks.sigma_heights).all()


@given(st.lists(runs(), min_size=1, max_size=5))
def test_what_grows_is_what_was_there_and_what_came(parts: list[list[FusionResult]]) -> None:
    pieces = [extract(results) for results in parts]
    growing = trajectories.GrowingTrajectories(pieces[0])
    seen = [(pieces[0], pieces[0])]
    for number, piece in enumerate(pieces[1:], 2):
        whole = Trajectories.concatenate([Trajectories.empty(CAMERAS), *pieces[:number]])
        seen.append((growing.append(piece), whole))
    for found, expected in seen:
        assert_same(found, expected)

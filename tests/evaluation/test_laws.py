"""Laws that hold whatever the data: metrics are metrics, names and order do not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.evaluation.scenes import (
    HALF_EXTENTS,
    Columns,
    as_truth,
    columns_of,
    comparison,
    distances,
    perturbed,
    point_sets,
    scattered,
    walks,
)
from tracker.evaluation import Evaluation, EvaluationSettings, evaluate
from tracker.evaluation.matching import GatedDistance, assign, match
from tracker.evaluation.ospa import gospa_parts, ospa, ospa2, ospa_parts

ORDERS = st.sampled_from([1.0, 1.5, 2.0, 4.0])
CUTOFFS = st.sampled_from([0.3, 1.0, 2.0])


def ospa_between(x: np.ndarray, y: np.ndarray, cutoff: float, order: float) -> float:
    return ospa_parts(distances(x, y), cutoff=cutoff, order=order)[0]


def gospa_between(x: np.ndarray, y: np.ndarray, cutoff: float, order: float) -> float:
    near, missed, false = gospa_parts(distances(x, y), cutoff=cutoff, order=order)
    return float((near + cutoff**order / 2 * (missed + false)) ** (1 / order))


@pytest.mark.parametrize("between", [ospa_between, gospa_between])
@given(x=point_sets(), y=point_sets(), z=point_sets(), cutoff=CUTOFFS, order=ORDERS)
def test_metric_of_sets(between, x, y, z, cutoff: float, order: float):
    assert between(x, x, cutoff, order) == pytest.approx(0.0, abs=1e-9)
    forth, back = between(x, y, cutoff, order), between(y, x, cutoff, order)
    assert forth == pytest.approx(back, abs=1e-9)
    assert forth >= 0.0
    via = between(x, z, cutoff, order) + between(z, y, cutoff, order)
    assert forth <= via + 1e-9


@given(x=point_sets(), y=point_sets(), cutoff=CUTOFFS, order=ORDERS)
def test_ospa_parts(x, y, cutoff: float, order: float):
    total, near, count = ospa_parts(distances(x, y), cutoff=cutoff, order=order)
    assert total <= cutoff + 1e-9
    assert total**order == pytest.approx(near**order + count**order, abs=1e-9)
    assert (count == 0.0) == (len(x) == len(y))
    assert near <= cutoff + 1e-9


def ospa2_between(x: Columns, y: Columns, cutoff: float, order: float) -> float:
    scene = comparison(as_truth(x), y, steps=12)
    value = ospa2(scene, cutoff=cutoff, order=order, window=1).whole
    assert value is not None
    return value


@given(
    seed=st.integers(0, 10_000),
    counts=st.tuples(*[st.integers(0, 4)] * 3),
    cutoff=CUTOFFS,
    order=ORDERS,
)
def test_ospa2_is_a_metric(seed: int, counts, cutoff: float, order: float):
    x, y, z = (scattered(seed + k, ids=n, steps=12, share=0.5) for k, n in enumerate(counts))
    assert ospa2_between(x, x, cutoff, order) == pytest.approx(0.0, abs=1e-9)
    forth = ospa2_between(x, y, cutoff, order)
    assert forth == pytest.approx(ospa2_between(y, x, cutoff, order), abs=1e-9)
    assert 0.0 <= forth <= cutoff + 1e-9
    via = ospa2_between(x, z, cutoff, order) + ospa2_between(z, y, cutoff, order)
    assert forth <= via + 1e-9


@given(seed=st.integers(0, 10_000), window=st.integers(1, 50), order=ORDERS)
def test_ospa2_from_its_definition(seed: int, window: int, order: float):
    truth = walks(seed, steps=20, people=3)
    tracks = perturbed(truth, seed, noise=0.4, missing=0.3, false=1.0)
    scene = comparison(truth, tracks)
    score = ospa2(scene, cutoff=1.0, order=order, window=window)
    values = score.over_time
    if window == 1:
        single = ospa(scene, cutoff=1.0, order=order).distance
        assert values == pytest.approx(single, abs=1e-9)
    for step in (0, 7, scene.steps - 1):
        expected = naive_ospa2(truth, tracks, range(max(0, step - window + 1), step + 1), order)
        assert values[step] == pytest.approx(expected, abs=1e-9)
    whole = naive_ospa2(truth, tracks, range(scene.steps), order)
    assert score.whole == pytest.approx(whole, abs=1e-9)


def naive_ospa2(truth, tracks, steps: range, order: float) -> float:
    """OSPA(2) pair by pair and step by step, with the cut-off 1."""

    def paths(rows) -> list[dict[int, np.ndarray]]:
        path: dict[int, dict[int, np.ndarray]] = {}
        for frame, name, place in zip(rows.frames, rows.ids, rows.positions, strict=True):
            if frame in steps:
                path.setdefault(int(name), {})[int(frame)] = place
        return list(path.values())

    def base(f: dict[int, np.ndarray], g: dict[int, np.ndarray]) -> float:
        union = set(f) | set(g)
        near = [
            min(1.0, float(np.linalg.norm(f[s] - g[s]))) if s in f and s in g else 1.0
            for s in union
        ]
        return sum(near) / len(union)

    first, second = paths(truth), paths(tracks)
    table = np.array([[base(f, g) for g in second] for f in first])
    table = table.reshape(len(first), len(second))
    return ospa_parts(table, cutoff=1.0, order=order)[0]


def figures(evaluation: Evaluation) -> list[float]:
    """All values, NaN where undefined."""
    return [np.nan if figure.value is None else figure.value for figure in evaluation.figures]


SETTINGS = st.builds(
    EvaluationSettings,
    distance=st.sampled_from(["position", "ground", "box"]),
    gate=st.sampled_from([0.4, 1.0]),
    order=st.sampled_from([1.0, 2.0]),
    window=st.sampled_from([1, 5, 100]),
)


@given(seed=st.integers(0, 10_000), settings=SETTINGS)
def test_names_and_order_do_not_matter(seed: int, settings: EvaluationSettings):
    rng = np.random.default_rng(seed)
    truth = walks(seed, uncertain=0.2)
    tracks = perturbed(truth, seed + 1)
    options = {"steps": 40, "half_extents": HALF_EXTENTS}
    reference = figures(evaluate(truth, tracks, settings, **options))

    people = rng.permutation(truth.ids.max() + 1)
    labels = rng.permutation(tracks.ids.max() + 1)
    renamed = figures(
        evaluate(
            replace(truth, ids=people[truth.ids]),
            replace(tracks, ids=labels[tracks.ids]),
            settings,
            **options,
        )
    )
    assert renamed == pytest.approx(reference, abs=1e-9, nan_ok=True)

    shuffle, mix = rng.permutation(len(truth.frames)), rng.permutation(len(tracks.frames))
    shuffled = figures(
        evaluate(
            type(truth)(
                truth.frames[shuffle],
                truth.ids[shuffle],
                truth.positions[shuffle],
                truth.valid[shuffle],
            ),
            Columns(tracks.frames[mix], tracks.ids[mix], tracks.positions[mix]),
            settings,
            **options,
        )
    )
    assert shuffled == pytest.approx(reference, rel=0, abs=1e-12, nan_ok=True)


@given(seed=st.integers(0, 10_000), settings=SETTINGS)
def test_bounds(seed: int, settings: EvaluationSettings):
    truth = walks(seed, uncertain=0.1)
    tracks = perturbed(truth, seed, noise=0.5, missing=0.3, false=3.0)
    scored = evaluate(truth, tracks, settings, half_extents=HALF_EXTENTS)
    for key in ("idf1", "idp", "idr", "hota", "deta", "assa", "loca", "found_share"):
        value = scored[key]
        assert value is None or 0.0 <= value <= 1.0
    for name in ("ospa", "ospa2", "ospa_localisation", "ospa_cardinality"):
        assert np.all(getattr(scored.series, name) <= settings.cutoff + 1e-9)
    series = scored.series
    assert np.array_equal(series.matches + series.misses, series.truth)
    assert np.array_equal(series.matches + series.false_positives, series.estimates)
    parts = series.gospa_localisation + series.gospa_missed + series.gospa_false
    assert parts == pytest.approx(series.gospa**settings.order, abs=1e-9)


@given(seed=st.integers(0, 10_000), settings=SETTINGS)
def test_truth_itself_is_perfect(seed: int, settings: EvaluationSettings):
    truth = walks(seed)
    scored = evaluate(truth, columns_of(truth), settings, half_extents=HALF_EXTENTS)
    for figure in scored.figures:
        if figure.definition.key == "fragmentations":
            continue  # those who leave and come back count as fragmented, as in TrackEval
        if figure.value is not None and figure.definition.direction in ("higher", "lower"):
            best = {"higher": 1.0, "lower": 0.0}[figure.definition.direction]
            if figure.definition.key == "mostly_tracked":
                best = len(scored.people)
            assert figure.value == pytest.approx(best, abs=1e-9), figure.definition.name


@given(seed=st.integers(0, 10_000))
def test_box_distance_is_symmetric_and_bounded(seed: int):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-3, 3, (2, 20, 3))
    measure = GatedDistance("box", 0.5, rng.uniform(0.1, 1.0, 3))
    assert measure.between(x, y) == pytest.approx(measure.between(y, x), abs=1e-12)
    assert measure.between(x, x) == pytest.approx(np.zeros(20), abs=1e-12)
    assert np.all((measure.between(x, y) >= 0.0) & (measure.between(x, y) <= 1.0))


@given(x=point_sets(), y=point_sets(), gate=st.sampled_from([0.5, 2.0]))
def test_assignment_is_one_to_one_within_the_gate(x, y, gate: float):
    apart = distances(x, y)
    rows, columns = assign(apart, gate)
    assert len(set(rows.tolist())) == len(rows)
    assert len(set(columns.tolist())) == len(columns)
    assert np.all(apart[rows, columns] <= gate)
    # nothing that could still be paired is left
    left = np.delete(np.delete(apart, rows, axis=0), columns, axis=1)
    assert not np.any(left <= gate)


def test_pairs_of_each_step_are_rows_of_that_step():
    truth = walks(1)
    scene = comparison(truth, perturbed(truth, 2))
    pairs = match(scene)
    assert len(pairs)
    assert np.array_equal(
        scene.truth.frames[pairs.truth_rows], scene.tracks.frames[pairs.track_rows]
    )

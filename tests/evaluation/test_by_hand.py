"""One example worked on paper for each metric; the scene is `scenes.by_hand`."""

from __future__ import annotations

import numpy as np
import pytest

from tests.evaluation.scenes import by_hand, comparison, tracks_of, truth_of
from tracker.evaluation import evaluate
from tracker.evaluation.clear import clear
from tracker.evaluation.hota import hota
from tracker.evaluation.identity import identity
from tracker.evaluation.matching import GatedDistance
from tracker.evaluation.ospa import gospa, ospa, ospa2
from tracker.evaluation.pixels import pixels
from tracker.evaluation.positions import positions
from tracker.geometry.camera import Camera


def test_clear():
    # pairs: 0: 1–10 at 0.1, 2–20 at 0.4; 1: 1–10 at 0.3; 2: 1–20 at 0.2, 2–10 at 0.2, both
    # switched; 3: 2–10 at 0.2. So 6 pairs of 8 true positions, 2 missed, 1 false, 2 switches.
    score = clear(comparison(*by_hand()))
    assert score.misses.tolist() == [0, 1, 0, 1]
    assert score.false_positives.tolist() == [0, 0, 0, 1]
    assert score.id_switches.tolist() == [0, 0, 2, 0]
    assert score.mota == pytest.approx(1 - (2 + 1 + 2) / 8)
    assert score.motp == pytest.approx((0.1 + 0.4 + 0.3 + 0.2 + 0.2 + 0.2) / 6)
    # person 2 is lost at step 1 and taken up again; person 1 is lost at the end only
    assert score.fragmentations.tolist() == [0, 1]
    # both are paired at 3 of 4 steps
    assert score.statuses == ["partly tracked"] * 2


def test_clear_keeps_the_pair_of_the_step_before():
    # at step 1 track 20 comes nearer to the person than track 10, which is still in the gate
    truth = truth_of([(0, 1, 0, 0, 0), (1, 1, 0, 0, 0)])
    tracks = tracks_of([(0, 10, 0.1, 0, 0), (1, 10, 0.8, 0, 0), (1, 20, 0.1, 0, 0)])
    score = clear(comparison(truth, tracks))
    assert score.id_switches.sum() == 0
    assert score.motp == pytest.approx(0.45)


def test_clear_prefers_no_pair_of_an_earlier_step():
    # at step 1 track 10 is out of the gate: at step 2 the nearer of both takes the person
    truth = truth_of([(step, 1, 0, 0, 0) for step in range(3)])
    tracks = tracks_of(
        [(0, 10, 0.1, 0, 0), (1, 10, 1.5, 0, 0), (2, 10, 0.8, 0, 0), (2, 20, 0.1, 0, 0)]
    )
    score = clear(comparison(truth, tracks))
    assert score.id_switches.tolist() == [0, 0, 1]
    assert score.motp == pytest.approx(0.1)


def test_identity():
    # within the gate together: 1–10 twice, 1–20 once, 2–20 once, 2–10 twice.
    # Either map gives IDTP = 3 of 7 estimates and 8 true positions.
    score = identity(comparison(*by_hand()))
    assert (score.true_positives, score.false_positives, score.false_negatives) == (3, 4, 5)
    assert score.precision == pytest.approx(3 / 7)
    assert score.recall == pytest.approx(3 / 8)
    assert score.f1 == pytest.approx(6 / 15)


def test_hota():
    # similarities 1 − d: 1–10 0.9, 2–20 0.6, 1–10 0.7, 1–20 0.8, 2–10 0.8, 2–10 0.8
    score = hota(comparison(*by_hand()))
    assert score is not None
    # α = 0.5: all 6 pairs count, 2 missed, 1 false. Lives: people 4 and 4, tracks 4, 2, 1.
    # 1–10 shares 2 of 4 + 4 − 2, 2–10 likewise; 1–20 and 2–20 share 1 of 4 + 2 − 1.
    assert score.detection[9] == pytest.approx(6 / 9)
    assert score.association[9] == pytest.approx((4 * 2 / 6 + 2 * 1 / 5) / 6)
    assert score.localisation[9] == pytest.approx(4.6 / 6)
    # α = 0.75: 1–10 once, 1–20 once, 2–10 twice count; 4 missed, 3 false
    assert score.detection[14] == pytest.approx(4 / 11)
    assert score.association[14] == pytest.approx((1 / 7 + 1 / 5 + 2 * 2 / 6) / 4)
    assert score.hota[14] == pytest.approx(np.sqrt(4 / 11 * (1 / 7 + 1 / 5 + 2 / 3) / 4))


def test_ospa():
    # n = 2 always. Step 1 lacks one: (0.3 + 1) / 2. Step 3: 2–10 at 0.2, 1–30 cut at 1.
    score = ospa(comparison(*by_hand()), cutoff=1.0, order=1.0)
    assert score.distance == pytest.approx([0.25, 0.65, 0.2, 0.6])
    assert score.localisation == pytest.approx([0.25, 0.15, 0.2, 0.6])
    assert score.cardinality == pytest.approx([0.0, 0.5, 0.0, 0.0])
    squared = ospa(comparison(*by_hand()), cutoff=1.0, order=2.0)
    assert squared.distance[1] == pytest.approx(np.sqrt((0.3**2 + 1) / 2))


def test_ospa2():
    # whole: d(1, 10) = (0.1 + 0.3 + 1 + 1)/4 = 0.6, d(1, 20) = (1 + 1 + 0.2 + 1)/4 = 0.8,
    # d(2, 10) = (1 + 1 + 0.2 + 0.2)/4 = 0.6, d(2, 20) = (0.4 + 1 + 1 + 1)/4 = 0.85,
    # d(·, 30) = 1. Best is 1–20 and 2–10 with 1.4, the third track costs 1: 2.4 / 3.
    scene = comparison(*by_hand())
    score = ospa2(scene, cutoff=1.0, order=1.0, window=2)
    assert score.whole == pytest.approx(0.8)
    # window 2 at step 1 holds steps 0 and 1: d(1, 10) = 0.2, d(2, 20) = (0.4 + 1)/2 = 0.7.
    # At step 2 it holds 1 and 2: d(1, 20) = (1 + 0.2)/2, d(2, 10) = (1 + 0.2)/2.
    # At step 3 it holds 2 and 3: d(1, 20) = (0.2 + 1)/2, d(2, 10) = 0.2, track 30 costs 1.
    assert score.over_time == pytest.approx([0.25, 0.45, (0.6 + 0.6) / 2, (0.6 + 0.2 + 1) / 3])


def test_gospa():
    # step 1: 0.3 and one missed, 1/2; step 3: 0.2, one missed and one false
    score = gospa(comparison(*by_hand()), cutoff=1.0, order=1.0)
    assert score.distance == pytest.approx([0.5, 0.8, 0.4, 1.2])
    assert score.localisation == pytest.approx([0.5, 0.3, 0.4, 0.2])
    assert score.missed == pytest.approx([0.0, 0.5, 0.0, 0.5])
    assert score.false == pytest.approx([0.0, 0.0, 0.0, 0.5])
    squared = gospa(comparison(*by_hand()), cutoff=1.0, order=2.0)
    assert squared.distance[1] == pytest.approx(np.sqrt(0.3**2 + 0.5))


def test_positions():
    # errors 0.1 0.4 | 0.3 | 0.2 0.2 | 0.2; within 0.3: person 1 three times, person 2 twice
    score = positions(comparison(*by_hand()), near=0.3)
    assert score.error == pytest.approx(1.4 / 6)
    # sorted 0.1 0.2 0.2 0.2 0.3 0.4: 95 % lies 0.75 of the way from the fifth to the sixth
    assert score.error_95 == pytest.approx(0.375)
    assert score.found_by_person.tolist() == [3, 2]
    assert score.found_share == pytest.approx(5 / 8)
    assert score.false_per_step == 2 / 4
    assert np.isnan(score.by_person).tolist() == [
        [False, False, False, True],
        [False, True, False, False],
    ]
    # estimates 2 1 2 2 against 2
    assert score.surplus.tolist() == [0, -1, 0, 0]
    result = evaluate(*by_hand())
    assert (result["cardinality_error"], result["cardinality_bias"]) == (0.25, -0.25)


def test_box_distance():
    # boxes of 2 × 2 × 2 m, one metre apart along x: shared 4, union 12, hull 3 · 2 · 2 = 12;
    # three metres apart: shared 0, union 16, hull 20
    measure = GatedDistance("box", 0.5, np.ones(3))
    zero = np.zeros((4, 3))
    apart = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], dtype=float)
    expected = [(1 - g) / 2 for g in (1, 4 / 12, 0, -4 / 20)]
    assert measure.between(zero, apart) == pytest.approx(expected)


def test_pixels():
    # a camera at the origin looks along y, 100 pixels a metre at one metre. A flat square of
    # 1 m at 10 m is 10 × 10 pixels; 0.2 m aside is 2 pixels aside: IoU = 80 / 120.
    # The second person is behind the camera, the second estimate alone in the picture.
    camera = Camera(
        "front",
        (100, 100),
        np.array([[100.0, 0, 50], [0, 100, 50], [0, 0, 1]]),
        np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
        np.zeros(3),
        np.zeros(5),
    )
    truth = truth_of([(0, 1, 0, 10, 0), (0, 2, 0, -10, 0)])
    tracks = tracks_of([(0, 7, 0.2, 10, 0), (0, 8, 3, 10, 0)])
    scene = comparison(truth, tracks, half_extents=np.array([0.5, 0.0, 0.5]))
    (score,) = pixels(scene, [camera], overlap=0.5)
    assert score.error == pytest.approx(2.0)
    assert score.overlap == pytest.approx(2 / 3)
    assert (score.people, score.estimates) == (1, 2)
    assert score.found_share == 1.0
    assert score.false_per_step == 1.0

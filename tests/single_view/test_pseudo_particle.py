"""Particles, the hypothesis matrix, its best assignment, and who is new, vanished, returned."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.kernels.pictures import images
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.single_view.protocol import ViewEvent
from tracker.single_view.pseudo_particle import hypotheses, particles
from tracker.single_view.pseudo_particle.hypotheses import best_hypothesis, target_probabilities
from tracker.single_view.pseudo_particle.method import PseudoParticle
from tracker.single_view.pseudo_particle.particles import Clusters, clusters
from tracker.single_view.pseudo_particle.track_management import Targets, Tracks, manage

CENTRES = np.array([[60.0, 50.0, 10.0, 15.0], [110.0, 52.0, 12.0, 16.0], [62.0, 140.0, 8.0, 12.0]])

logarithms = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30)


def around(centres: ndarray, counts: list[int], seed: int = 0, spread: float = 0.3) -> ndarray:
    """Boxes that scatter by a share of their half sizes."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [
            centre + rng.normal(0.0, spread, (count, 4)) * centre[[2, 3, 2, 3]] * [1, 1, 0.2, 0.2]
            for centre, count in zip(centres, counts, strict=True)
        ]
    )


def one_group(boxes: ndarray) -> ndarray:
    return np.zeros(len(boxes), dtype=np.int64)


def together(
    boxes: ndarray, counts: ndarray, merge_distance: float = 1.0, **more: float
) -> Clusters:
    """Clusters of all particles at once."""
    return clusters(
        boxes, counts, one_group(boxes), merge_distance=merge_distance, **{"bandwidth": 1.0, **more}
    )


def test_a_weight_is_that_of_the_target_it_fits_best() -> None:
    distances = np.array([[0.2, 0.9], [0.8, 0.4], [1.0, 1.0]])
    weights = np.exp(particles.log_likelihoods(distances, 20.0))
    np.testing.assert_allclose(weights, np.exp(-20.0 * distances).max(axis=1))


@given(logarithms, st.floats(-1e5, 1e5))
def test_weights_sum_to_1_and_only_ratios_count(values: list[float], shift: float) -> None:
    weights = particles.normalised(np.array(values))
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(weights >= 0.0)
    np.testing.assert_allclose(particles.normalised(np.array(values) + shift), weights, atol=1e-8)


@given(logarithms)
def test_each_group_keeps_its_share_of_the_particles(values: list[float]) -> None:
    scores = np.array(values)
    groups = np.arange(len(scores)) % 3 * 2  # the groups between have no members
    weights = particles.normalised_by_group(scores, groups)
    for group in np.unique(groups):
        members = groups == group
        assert weights[members].sum() == pytest.approx(members.mean())
        np.testing.assert_allclose(
            weights[members] / weights[members].sum(), particles.normalised(scores[members])
        )
    same = particles.normalised_by_group(scores, np.zeros(len(scores), dtype=np.int64))
    np.testing.assert_allclose(same, particles.normalised(scores))


def test_no_particles_have_no_weights() -> None:
    nothing = np.zeros(0)
    none = np.zeros(0, dtype=np.int64)
    assert len(particles.normalised(nothing)) == 0
    assert len(particles.normalised_by_group(nothing, none)) == 0
    assert len(particles.resample(nothing, 100, np.random.default_rng(0))) == 0
    assert particles.effective_number(nothing) == 0.0


def test_the_effective_number_runs_from_one_to_all() -> None:
    assert particles.effective_number(np.full(40, 1 / 40)) == pytest.approx(40.0)
    assert particles.effective_number(np.eye(40)[3]) == pytest.approx(1.0)


def test_resampling_draws_each_particle_as_often_as_it_weighs() -> None:
    rng = np.random.default_rng(5)
    weights = particles.normalised(np.append(rng.normal(0.0, 1.0, 9), -np.inf))
    drawn = np.array([particles.resample(weights, 50, rng) for _ in range(4000)])
    assert np.all(drawn.sum(axis=1) == 50)
    assert drawn[:, -1].max() == 0
    # of a multinomial draw: mean n p, variance n p (1 - p)
    spread = np.sqrt(50 * weights * (1.0 - weights))
    assert np.all(np.abs(drawn.mean(axis=0) - 50 * weights) <= 4.0 * spread / np.sqrt(4000))
    np.testing.assert_allclose(drawn.var(axis=0), spread**2, rtol=0.15)


def test_the_modes_are_the_targets_the_largest_cluster_first() -> None:
    boxes = around(CENTRES, [90, 60, 30])
    found = together(boxes, np.ones(180, dtype=int))
    assert len(found.modes) == 3
    np.testing.assert_allclose(found.shares, [1 / 2, 1 / 3, 1 / 6], atol=0.03)
    assert np.abs((found.modes - CENTRES)[:, :2] / CENTRES[:, 2:]).max() < 0.12
    assert np.mean(found.owners == np.repeat([0, 1, 2], [90, 60, 30])) > 0.99


def test_a_climb_never_goes_down() -> None:
    # with one size for all the density that is climbed is the same everywhere
    boxes = around(CENTRES, [40, 30, 20], spread=0.6)
    boxes[:, 2:] = [10.0, 14.0]
    counts = np.random.default_rng(4).integers(1, 4, len(boxes)).astype(float)

    def density(points: ndarray) -> ndarray:
        offsets = (boxes[None, :, :2] - points[:, None, :2]) / [10.0, 14.0]
        return (counts * np.maximum(1.0 - (offsets**2).sum(axis=2), 0.0)).sum(axis=1)

    points, _ = images.epanechnikov_climb(boxes, counts, one_group(boxes), 1.0, 30, 0.0)
    assert np.all(density(points) >= density(boxes) - 1e-9)


@given(st.floats(0.1, 20.0), st.floats(-300.0, 300.0), st.floats(-300.0, 300.0))
def test_the_bandwidth_follows_the_radius(scale: float, x: float, y: float) -> None:
    boxes, counts = around(CENTRES, [30, 20, 10]), np.ones(60, dtype=int)
    here = together(boxes, counts)
    there = together(boxes * scale + [x, y, 0.0, 0.0], counts)
    np.testing.assert_array_equal(there.owners, here.owners)
    np.testing.assert_allclose(there.modes, here.modes * scale + [x, y, 0, 0], atol=1e-6)


def test_a_particle_drawn_twice_counts_as_two() -> None:
    boxes = around(CENTRES, [20, 15, 10], spread=0.6)
    counts = np.random.default_rng(2).integers(0, 4, len(boxes))
    once = together(boxes, counts)
    copies = together(np.repeat(boxes, counts, axis=0), np.ones(counts.sum(), dtype=int))
    np.testing.assert_allclose(once.modes, copies.modes)
    np.testing.assert_allclose(once.shares, copies.shares)
    np.testing.assert_array_equal(np.repeat(once.owners, counts), copies.owners)
    assert np.all(once.owners[counts == 0] == -1)
    assert once.shares.sum() == pytest.approx(1.0)


def test_each_group_has_modes_of_its_own() -> None:
    # half a box apart: together they are one, by themselves two
    pair = CENTRES[[0, 0]] + [[0.0, 0, 0, 0], [11.0, 0, 0, 0]]
    boxes, counts = around(pair, [80, 60], spread=0.25), np.ones(140, dtype=int)
    groups = np.repeat([4, 1], [80, 60])
    apart = clusters(boxes, counts, groups, bandwidth=1.0, merge_distance=1.0)
    assert len(apart.modes) == 2
    np.testing.assert_array_equal(apart.owners, np.repeat([0, 1], [80, 60]))
    np.testing.assert_allclose(apart.modes[:, 0], pair[:, 0], atol=0.8)
    for group, rows in ((0, boxes[:80]), (1, boxes[80:])):
        alone = together(rows, np.ones(len(rows), dtype=int))
        np.testing.assert_allclose(alone.modes, apart.modes[[group]])
    assert len(together(boxes, counts).modes) == 1


def test_modes_keep_their_distance() -> None:
    rng = np.random.default_rng(1)
    boxes = np.column_stack([rng.uniform(0, 90, (150, 2)), np.full((150, 2), 10.0)])
    found = together(boxes, np.ones(150, dtype=int), 1.5, bandwidth=0.6)
    between = np.linalg.norm(found.modes[:, None, :2] - found.modes[None, :, :2], axis=2)
    assert len(found.modes) > 5
    assert between[~np.eye(len(between), dtype=bool)].min() >= 15.0
    assert found.owners.min() == 0


def test_no_particles_have_no_modes() -> None:
    for boxes in (np.zeros((0, 4)), CENTRES):
        found = together(boxes, np.zeros(len(boxes), dtype=int))
        assert found.modes.shape == (0, 4)
        assert found.shares.shape == (0,)
        np.testing.assert_array_equal(found.owners, np.full(len(boxes), -1))


def test_particles_are_drawn_anew_around_each_target() -> None:
    rng = np.random.default_rng(8)
    sigmas = np.array([[5.0, 7.0], [2.0, 3.0], [0.0, 0.0]])
    drawn = particles.redistribute(CENTRES, sigmas, 9001, rng)
    assert len(drawn) == 9001
    for index in range(3):
        own = drawn[index::3]
        np.testing.assert_array_equal(own[:, 2:], np.tile(CENTRES[index, 2:], (len(own), 1)))
        np.testing.assert_allclose(own[:, :2].mean(axis=0), CENTRES[index, :2], atol=0.4)
        np.testing.assert_allclose(own[:, :2].std(axis=0), sigmas[index], rtol=0.06)
    assert len(particles.redistribute(np.zeros((0, 4)), np.zeros((0, 2)), 100, rng)) == 0
    assert len(particles.redistribute(CENTRES, sigmas, 0, rng)) == 0


LIKELY, UNLIKELY = 0.2, 0.9


def targets(boxes: list[list[float]], persons: list[int]) -> Targets:
    """Confirmed ones at rest."""
    count = len(boxes)
    return Targets(
        labels=np.arange(1, count + 1),
        persons=np.array(persons, dtype=np.int64),
        boxes=np.array(boxes).reshape(-1, 4),
        velocities=np.zeros((count, 2)),
        hits=np.full(count, 9),
        misses=np.zeros(count, dtype=np.int64),
        existences=np.ones(count),
    )


def matrix(
    modes: ndarray, distances: ndarray, expected: Targets, vacant: ndarray, evidence: float = 0.0
) -> ndarray:
    return hypotheses.hypothesis_matrix(
        modes,
        distances,
        np.full(len(modes), evidence),
        expected,
        vacant,
        sharpness=20.0,
        background_distance=0.5,
        position_sigma=1.0,
        position_gate=3.0,
    )


LEFT, RIGHT = [50.0, 60.0, 10.0, 14.0], [90.0, 60.0, 10.0, 14.0]


def test_the_matrix_is_the_formula() -> None:
    expected = targets([LEFT, RIGHT], [0, 1])
    modes = np.array([[55.0, 67.0, 9.0, 12.0]])
    found = matrix(modes, np.array([[0.3, 0.6]]), expected, np.array([1]), evidence=-0.7)
    at_left, at_right = 0.5**2 + 0.5**2, 3.5**2 + 0.5**2
    np.testing.assert_allclose(
        found[0],
        [
            -0.7 - 20 * 0.3 - 0.5 * at_left,
            -0.7 - 20 * 0.6 - 0.5 * at_right,
            -0.7 - 20 * 0.6 - 4.5,
            -20 * 0.5 - 4.5,
        ],
    )


@given(st.integers(0, 4), st.integers(0, 4), st.integers(0, 10**6))
def test_the_best_hypothesis_is_the_best_of_all(modes: int, columns: int, seed: int) -> None:
    logs = np.random.default_rng(seed).normal(0.0, 3.0, (modes, columns + 1))
    found = best_hypothesis(logs)
    choices = [
        choice
        for choice in itertools.product(range(columns + 1), repeat=modes)
        if all(choice.count(c) <= 1 for c in range(columns))
    ]
    totals = [sum(logs[m, c] for m, c in enumerate(choice)) for choice in choices]
    assert tuple(found) in choices
    assert sum(logs[m, c] for m, c in enumerate(found)) == pytest.approx(max(totals))


def test_the_probability_of_somebody() -> None:
    logs = np.log(np.array([[0.2, 0.3, 0.5], [1e-300, 1e-300, 1.0]]))
    np.testing.assert_allclose(target_probabilities(logs), [0.5, 0.0], atol=1e-12)
    assert target_probabilities(np.zeros((3, 1))).max() == 0.0
    assert target_probabilities(np.zeros((0, 4))).shape == (0,)
    assert best_hypothesis(np.zeros((0, 4))).shape == (0,)


def test_vacancies_are_what_each_person_has_left() -> None:
    there = targets([LEFT, RIGHT, LEFT], [1, 1, 2])
    np.testing.assert_array_equal(hypotheses.vacancies(there, 3, 2), [0, 0, 2])
    np.testing.assert_array_equal(hypotheses.vacancies(there, 3, 1), [0])
    np.testing.assert_array_equal(hypotheses.vacancies(Targets.none(), 2, 1), [0, 1])


def test_a_newcomer_stands_apart_and_the_surer_of_two_stays() -> None:
    modes = np.array([LEFT, [62.0, 60, 10, 14], [90.0, 60, 10, 14], [100.0, 60, 10, 14]])
    # the first is target 0; the others would be newcomers of the columns 1, 2 and 3
    columns = np.array([0, 1, 2, 3])
    sureness = np.array([0.9, 0.99, 0.5, 0.8])
    found = hypotheses.apart(modes, sureness, columns, 1, 4, 1.5)
    np.testing.assert_array_equal(found, [0, 4, 4, 3])
    np.testing.assert_array_equal(hypotheses.apart(modes, sureness, columns, 1, 4, 0.0), columns)


# who is there


class Story:
    """Steps of one camera, told as the modes and persons that were found at each."""

    def __init__(self, **changes: int) -> None:
        self.tracks = Tracks.empty()
        self.numbers = {
            "confirmation": 2,
            "patience": 3,
            "memory": 10,
            "newcomer_misses": 2,
            "velocity_memory": 0.8,
            **changes,
        }

    def step(self, *modes: tuple[float, int]) -> list[ViewEvent]:
        """Modes at these places along a line, of these persons."""
        expected = self.tracks.targets.moved(0.0)
        vacant = hypotheses.vacancies(expected, 2, 2)
        boxes = np.array([[x, 60.0, 10.0, 14.0] for x, _ in modes]).reshape(-1, 4)
        distances = np.full((len(modes), 2), UNLIKELY)
        for row, (_, person) in enumerate(modes):
            distances[row, person] = LIKELY
        logs = matrix(boxes, distances, expected, vacant)
        self.tracks, events = manage(
            self.tracks,
            expected,
            boxes,
            target_probabilities(logs),
            best_hypothesis(logs),
            vacant,
            **self.numbers,
        )
        return list(events)


def event(kind: str, label: int) -> ViewEvent:
    return ViewEvent(kind, (label,))  # type: ignore[arg-type]


def test_somebody_comes_goes_and_returns() -> None:
    story = Story()
    assert story.step((50.0, 0)) == []  # seen once: not sure yet
    assert story.step((51.0, 0)) == [event("new", 1)]
    assert [story.step((52.0, 0)), story.step()] == [[], []]
    kept = story.tracks.targets
    np.testing.assert_allclose(kept.boxes[0, :2], [52.0, 60.0])
    assert 0.0 < kept.existences[0] < 0.99
    assert story.step((52.0, 0)) == []  # waited for, found again: nothing to tell
    assert [story.step() for _ in range(3)] == [[]] * 3
    assert story.step() == [event("vanished", 1)]
    assert len(story.tracks.targets) == 0
    assert story.step((200.0, 1), (90.0, 0)) == []
    assert story.step((201.0, 1), (91.0, 0)) == [event("new", 2), event("returned", 1)]
    assert len(story.tracks.departed.labels) == 0


def test_a_label_is_given_once() -> None:
    rng = np.random.default_rng(3)
    story, given = Story(patience=1), []
    for _ in range(200):
        modes = [(float(x), int(rng.integers(2))) for x in rng.choice(12, 3, replace=False) * 40]
        given += [e.labels[0] for e in story.step(*modes) if e.kind == "new"]
        labels = story.tracks.targets.labels
        sure = labels[story.tracks.targets.confirmed]
        assert len(set(sure)) == len(sure)
        assert np.all(np.bincount(story.tracks.targets.persons, minlength=2) <= 2)
    assert len(given) > 5
    assert given == list(range(1, len(given) + 1))


# particles of a target, and around it


def with_numbers(**numbers: object) -> Any:
    """What the method's steps ask of it: its parameters and the time of a step."""
    of_colours = {key: numbers.pop(key) for key in ("samples", "motion_sigma") if key in numbers}
    return SimpleNamespace(
        _parameters=PseudoParticleParams(**numbers),
        _colours=ColourPhdParams(**of_colours),
        _step_time=0.04,
    )


def test_a_particle_belongs_to_the_nearest_target_within_its_gate() -> None:
    method = with_numbers(position_gate=2.0, position_sigma=1.5)
    there = targets([LEFT, [90.0, 60.0, 10.0, 14.0], [60.0, 20.0, 0.1, 0.1]], [0, 1, 0])
    boxes = np.array([
        [79.9, 60.0, 1, 1], [80.1, 60.0, 1, 1], [69.9, 60.0, 1, 1], [50.0, 101.9, 1, 1],
        [50.0, 102.1, 1, 1], [119.9, 60.0, 1, 1], [120.1, 60.0, 1, 1], [61.4, 20.0, 1, 1],
    ], dtype=float)  # fmt: skip
    found = PseudoParticle._nearest(method, boxes, there)
    assert found.tolist() == [1, 1, 0, 0, 3, 1, 3, 2]
    assert PseudoParticle._nearest(method, boxes, Targets.none()).tolist() == [0] * len(boxes)
    gates = PseudoParticle._gates(method, there)
    np.testing.assert_allclose(gates[0], [50.0, 60.0, 30.0**2, 0.0, 42.0**2])


def test_particles_are_drawn_again_around_where_each_target_goes_the_wider_the_longer_unseen() -> (
    None
):
    method = with_numbers(samples=5000, newcomer_share=0.25, velocity_share=0.5,
                          redistribution=0.4, motion_sigma=2.0)  # fmt: skip
    there = replace(
        targets([LEFT, [190.0, 60.0, 10.0, 14.0], [390.0, 60.0, 10.0, 14.0]], [0, 1, 0]),
        velocities=np.array([[4.0, 0.0], [0.0, -2.0], [0.0, 0.0]]), misses=np.array([0, 0, 9]),
    )  # fmt: skip
    rng = np.random.default_rng(0)
    drawn = PseudoParticle._around(method, there, np.zeros((0, 4)), rng)
    assert len(drawn) == 3750
    for middle, wide, own in zip(
        ([52.0, 60.0], [190.0, 59.0], [390.0, 60.0]),
        (0.4, 0.4, np.sqrt(0.4**2 + 4.0 * 0.04 * 9)),
        (drawn[drawn[:, 0] < 120], drawn[np.abs(drawn[:, 0] - 190) < 60], drawn[drawn[:, 0] > 260]),
        strict=True,
    ):
        assert len(own) == 1250
        np.testing.assert_allclose(own[:, :2].mean(axis=0), middle, atol=0.12 * wide * 14.0)
        np.testing.assert_allclose(own[:, :2].std(axis=0), [wide * 10.0, wide * 14.0], rtol=0.06)
        np.testing.assert_array_equal(own[:, 2:], np.tile([10.0, 14.0], (1250, 1)))
    assert PseudoParticle._around(method, Targets.none(), drawn, rng).shape == (0, 4)
    plain = with_numbers(samples=60, newcomer_share=0.25, redistribution=0.0)
    resampled = np.arange(240.0).reshape(60, 4)
    kept = PseudoParticle._around(plain, there, resampled, rng)
    assert len(kept) == len(np.unique(kept[:, 0])) == 45
    assert np.isin(kept[:, 0], resampled[:, 0]).all()

"""Exact marginals beside Stone Soup's JPDA: by enumeration, and by hypothesis management (EHM2)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.filters.association.stone_soup_jpda import associators, cluster
from tracker.filters.association import exact_marginals, log_weights, marginals_of, murty


@pytest.mark.parametrize(
    ("name", "targets", "seed"),
    [("JPDA", 2, 0), ("JPDA", 3, 1), ("EHM2", 3, 2), ("EHM2", 5, 3), ("EHM2", 6, 4)],
)
def test_exact_marginals_are_those_of_stone_soup(name: str, targets: int, seed: int) -> None:
    problem = cluster(targets, seed)
    expected = problem.stone_soup(associators()[name])
    found = exact_marginals(problem.missed, problem.detected, problem.unexplained)
    assert_allclose(np.column_stack([found.missed, found.detected]), expected, atol=1e-9)
    assert ((expected[:, 1:] > 0.01).sum(axis=1) > 1).any(), "they compete"


def test_a_few_hundred_best_events_are_close_to_all_of_them() -> None:
    problem = cluster(5, 3)
    weights = problem.missed, problem.detected, problem.unexplained
    events = murty(*weights, 300)
    found = marginals_of(events, log_weights(events, *weights))
    assert_allclose(found.detected, exact_marginals(*weights).detected, atol=0.02)

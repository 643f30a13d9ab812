"""Newcomers where unexplained boxes of two or more cameras agree on a place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.special import logit, logsumexp
from scipy.stats import multivariate_normal

from tests import world
from tests.fusion.rooms import CAMERAS, HALF_EXTENTS, NO_BOXES, ROOM, births, evidence
from tracker.fusion.measurement_births import Newborns
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.single_view.protocol import ViewResult

BIRTH_RATE, P_D = 0.005, 0.95


def seen(places: ndarray, clutter: float = 0.0, seed: int = 0) -> tuple[ViewResult, ...]:
    """One step's boxes of people at some places, each side known to three pixels."""
    rng = np.random.default_rng(seed)
    return world.views(world.boxes(CAMERAS, places[None], 3.0, rng, clutter=clutter))[0]


def proposed(newborns: Newborns | None) -> Newborns:
    assert newborns is not None
    return newborns


@pytest.mark.parametrize("kind", ["centre", "box"])
def test_people_are_found_where_they_stand(kind: MeasurementKind) -> None:
    places = np.array([[0.5, -0.8, 0.85], [-1.2, 1.0, 0.85]])
    found = proposed(births(kind).propose(evidence(seen(places), kind)))
    sure = found.take(np.flatnonzero(found.existences > 0.9))
    order = np.argsort(-sure.positions[:, 0])
    assert_allclose(sure.positions[order], places, atol=0.12)
    assert (sure.sources >= 0).sum(axis=0).tolist() == [4, 4]
    sigmas = np.sqrt(np.diagonal(sure.covariances, axis1=1, axis2=2))
    assert (np.abs(sure.positions[order] - places) < 5.0 * sigmas[order]).all()


@pytest.mark.parametrize("kind", ["centre", "box"])
@pytest.mark.parametrize("missing", [None, 1, 2])
def test_the_odds_are_the_integral_over_the_room(
    kind: MeasurementKind, missing: int | None
) -> None:
    """Λ by importance sampling, term by term as the class says it."""
    views = tuple(
        NO_BOXES if c == missing else view
        for c, view in enumerate(seen(np.array([[0.5, -0.3, 0.85]]), seed=3))
    )
    found = proposed(births(kind).propose(evidence(views, kind))).take(np.array([0]))
    assert (found.sources[:, 0] >= 0).tolist() == [c != missing for c in range(4)]

    proposal = multivariate_normal(found.positions[0], 2.0 * found.covariances[0], seed=1)
    places = np.atleast_2d(proposal.rvs(4_000))
    model = TargetModel(HALF_EXTENTS, kind)
    log_terms = np.full(len(places), np.log(BIRTH_RATE / np.prod(ROOM.maximum - ROOM.minimum)))
    for camera, view in zip(CAMERAS, views, strict=True):
        if not len(view.boxes):
            log_terms += np.log(1.0 - P_D)
            continue
        (value,), (noise,) = model.measured(view.boxes, view.sigmas, 1.0)
        residuals = model.expected(camera, places).values - value
        density = multivariate_normal(np.zeros(len(value)), noise).logpdf(residuals)
        log_terms += np.log(P_D) + density - np.log(1e-8 if kind != "centre" else 1e-6)
    log_odds = logsumexp(log_terms - proposal.logpdf(places)) - np.log(len(places))
    assert logit(found.existences[0]) == pytest.approx(log_odds, abs=0.1)


def test_what_a_box_looks_like_adds_to_the_odds() -> None:
    views = seen(np.array([[0.5, -0.3, 0.85]]), seed=3)
    before = proposed(births().propose(evidence(views))).take(np.array([0]))
    told = [1.5, -4.0, 0.0, -2.0]
    looks = tuple(
        replace(view, log_ratios=np.full(len(view.boxes), ratio))
        for view, ratio in zip(views, told, strict=True)
    )
    after = proposed(births().propose(evidence(looks))).take(np.array([0]))
    assert after.sources.tolist() == before.sources.tolist()
    change = logit(after.existences[0]) - logit(before.existences[0])
    assert change == pytest.approx(sum(told), abs=0.02)  # but for what misses have in Λ


def test_no_box_is_used_twice() -> None:
    rng = np.random.default_rng(1)
    for seed in range(10):
        places = np.append(rng.uniform(-2, 2, (5, 2)), np.full((5, 1), 0.85), axis=1)
        found = proposed(births().propose(evidence(seen(places, 2.0, seed))))
        for row in found.sources:
            used = row[row >= 0]
            assert len(set(used.tolist())) == len(used)
        assert (np.diff(found.existences) <= 0.0).all(), "the surest first"


def test_the_more_cameras_agree_the_surer() -> None:
    views = seen(np.array([[0.3, 0.2, 0.85]]))
    odds = []
    for count in (2, 3, 4):
        some = tuple(view if c < count else NO_BOXES for c, view in enumerate(views))
        found = proposed(births().propose(evidence(some)))
        odds.append(found.existences[0] / (1.0 - found.existences[0] + 1e-15))
    assert odds[0] < odds[1] < odds[2]


def test_a_box_that_somebody_made_is_no_source_of_a_newcomer() -> None:
    mixed = evidence(seen(np.array([[0.5, -0.8, 0.85]])))
    mixed.unexplained[mixed.starts[2]] = 0.0
    found = proposed(births().propose(mixed))
    assert found.sources[:, 0].tolist() == [0, 0, -1, 0]

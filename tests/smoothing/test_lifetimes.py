"""Who was there, by how many cameras agree and by how the boxes look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine.synthetic import CAMERAS, sequence, walk
from tests.smoothing.test_positions_laws import PLAIN, STEPS, alone
from tracker import pipeline
from tracker.parameters import with_values
from tracker.smoothing.lifetimes import lifetimes
from tracker.smoothing.smoother import Smoother


def odds_of(cameras: int, log_ratio: float | None) -> float:
    """Of one walker whom so many cameras show, whose every box looks so much like a person."""
    whole = sequence(
        [(0, walk((-1.0, 0.2, 1.0), (0.9, -0.3, 1.1), STEPS, sway=0.4))], STEPS, CAMERAS[:cameras]
    )
    run = pipeline.compute(whole, with_values(PLAIN, {"smoothing_method": "none"}))
    views = run.views
    if log_ratio is not None:
        views = [
            tuple(replace(view, log_ratios=np.full(len(view.boxes), log_ratio)) for view in step)
            for step in views
        ]
    smoother = Smoother(whole, PLAIN.fusion, views)
    paths, links = alone(smoother)
    paths = smoother.fit(paths, links, iterations=5).paths
    shared = smoother.share(paths)
    shared = replace(shared, links=links, missed=np.zeros_like(shared.missed))
    return float(lifetimes(smoother, paths, shared, PLAIN.smoothing)[1][0])


def test_a_third_camera_outweighs_doubt_that_two_do_not() -> None:
    doubtful = -3.5
    assert odds_of(2, doubtful) < 0.0 < odds_of(3, doubtful)


def test_of_a_box_in_one_camera_only_its_looks_count() -> None:
    assert odds_of(1, None) > 10.0
    assert odds_of(1, 0.01) == pytest.approx(odds_of(1, 0.02), abs=1.0)
    assert odds_of(1, 0.01) < 1.0
    assert odds_of(1, -1.0) < odds_of(1, 0.01) < odds_of(1, 2.0)
    assert odds_of(1, 2.0) > 5.0


def test_where_nothing_is_told_of_looks_every_camera_votes() -> None:
    assert odds_of(1, None) < odds_of(2, None) < odds_of(3, None)
    # nobody is surer of who is seen well by two than of whom no looks are told
    assert odds_of(2, 1e-6) == pytest.approx(odds_of(2, None), rel=0.01)

"""Stage 1's random numbers: of their own for every camera, step and seed, wherever a run begins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.synthetic import CAMERAS, crossing, sequence
from tracker import single_view
from tracker.parameters.catalogue import RunParameters
from tracker.runs.pipeline import stage_keys
from tracker.runs.run import Run
from tracker.runs.single_views import SingleViews
from tracker.sequences.pictures.frames import FrameReader
from tracker.single_view.protocol import ViewResult

STEPS = 7
WHOLE = sequence(crossing(STEPS), STEPS)
PARAMETERS = RunParameters(single_view="none")


class Drawing:
    """A method whose boxes are what its generator draws."""

    needs_pictures = False

    def start(self) -> int:
        """How many steps were taken."""
        return 0

    def step(
        self, state: int, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[int, ViewResult]:
        """One box of random numbers."""
        box = rng.random((1, 4))
        return state + 1, ViewResult.of_boxes(box, np.ones(1), box)


def drawn(monkeypatch: pytest.MonkeyPatch, seed: int, first: int = 0) -> ndarray:
    """What each camera draws at each step from ``first`` on: (steps, C, 4)."""
    monkeypatch.setattr(single_view, "create", lambda *_: Drawing())
    run = Run(WHOLE, PARAMETERS, seed, stage_keys(WHOLE, PARAMETERS, seed))
    nothing = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
    run.views = run.views.alike([(nothing,) * len(CAMERAS)] * first)
    run.view_states = (first,) * len(CAMERAS) if first else None
    with FrameReader(WHOLE) as reader, SingleViews(run, reader, lambda: False) as steps:
        taken: list[tuple[tuple[ViewResult, ...], tuple[Any, ...]]] = list(steps)
    assert [states for _, states in taken] == [(n + 1,) * len(CAMERAS) for n in range(first, STEPS)]
    return np.array([[view.boxes[0] for view in views] for views, _ in taken])


def test_no_two_cameras_and_no_two_steps_draw_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(monkeypatch, 5)
    assert found.shape == (STEPS, len(CAMERAS), 4)
    assert len(np.unique(found)) == found.size


def test_the_numbers_are_those_of_seed_camera_and_step(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(monkeypatch, 5)
    for step in range(STEPS):
        for camera in range(len(CAMERAS)):
            rng = np.random.default_rng((5, camera, step))
            assert found[step, camera].tolist() == rng.random(4).tolist()


def test_a_run_that_goes_on_draws_what_it_would_have_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = drawn(monkeypatch, 5)
    assert np.array_equal(drawn(monkeypatch, 5, first=3), whole[3:])
    other = drawn(monkeypatch, 6)
    assert not np.intersect1d(whole, other).size, "another seed, other numbers"

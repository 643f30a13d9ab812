"""The queue of *Check* names the camera whose boxes are out of line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.state.snapshot import Snapshot
from app.web.corrections import queue_of
from tests.random_rooms import random_room
from tracker.review.queue import Queue
from tracker.runs.fitting import default_parameters
from tracker.runs.pipeline import compute


def test_the_queue_names_a_camera_that_is_out_of_line() -> None:
    room = random_room(1, cameras=4, people=3, steps=120)
    run = compute(room, default_parameters(room))
    nothing = Queue((), 0, "the run")
    assert queue_of(Snapshot(run=run), nothing, frozenset()).cameras == []
    smoothed = run.smoothed
    assert smoothed is not None
    assert smoothed.cameras is not None
    factors = np.ones((4, 4))
    factors[1, 3] = 2.6
    odd = replace(smoothed.cameras, factors=factors, least=0.9 * factors)
    run.smoothed = replace(smoothed, cameras=odd)
    (note,) = queue_of(Snapshot(run=run), nothing, frozenset()).cameras
    assert note.startswith(f'the boxes of camera "{room.views[1].camera.name}" are out of line')
    assert queue_of(Snapshot(), nothing, frozenset()).cameras == []

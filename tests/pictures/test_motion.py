"""A background made by people who stay is doubted, and what moves in front of it is foreground."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy import ndarray

from tests.engine.rooms import SKIN, clip, empty_room, photograph
from tracker.parameters import ForegroundParams
from tracker.pictures.foreground import BackgroundModel, MovingForeground

SECONDS = 0.04


def exercising(steps: int) -> list[ndarray]:
    """Somebody stays in one place all the time and bends from side to side."""
    pictures = []
    for step in range(steps):
        room = empty_room()
        lean = round(14 * np.sin(step / 4.0))
        cv2.line(room, (64, 90), (64 + lean, 50), SKIN, 15)
        pictures.append(photograph(room, seed=step))
    return pictures


def where(step: int) -> ndarray:
    blank = np.zeros(empty_room().shape)
    cv2.line(blank, (64, 90), (64 + round(14 * np.sin(step / 4.0)), 50), SKIN, 15)
    return blank.any(axis=2)


def learnt(pictures: list[ndarray]) -> BackgroundModel:
    model = BackgroundModel.learn(pictures)
    assert model is not None
    return model


def test_who_passes_by_leaves_no_doubt_and_who_stays_does() -> None:
    parameters = ForegroundParams()
    passing = learnt(clip(np.ones(25)))
    assert passing.doubt(parameters) == 0.0
    staying = learnt(exercising(32))
    assert staying.doubt(parameters) > 0.5


def test_an_empty_room_leaves_no_doubt() -> None:
    model = learnt([photograph(empty_room(), seed=k) for k in range(20)])
    assert model.restlessness == 0.0


@pytest.mark.parametrize("memory", [0.4, 0.8])
def test_what_moved_lately_is_foreground(memory: float) -> None:
    pictures = exercising(32)
    background = learnt(pictures)
    parameters = ForegroundParams(motion_memory=memory)
    model = MovingForeground(background, parameters, SECONDS)
    state = model.start()
    inside, plain, outside = [], [], []
    for step, picture in enumerate(pictures):
        state, found = model.step(state, picture)
        alone = background.foreground(picture, parameters)
        assert (found.mask >= alone).all()
        if step > 20:
            upper = where(step)
            upper[70:] = False  # the legs hardly move
            inside.append(found.mask[upper].mean())
            plain.append(alone[upper].mean())
            outside.append(found.mask[:, :30].mean())
    assert np.mean(inside) > 0.75
    assert np.mean(inside) > np.mean(plain) + 0.2
    assert np.max(outside) < 0.02


def test_a_light_that_is_switched_is_nobody() -> None:
    room = empty_room()
    background = learnt(exercising(32))
    model = MovingForeground(background, ForegroundParams(), SECONDS)
    state = model.start()
    for step in range(6):
        state, _ = model.step(state, photograph(room, seed=step))
    for step in range(6):
        state, _ = model.step(state, photograph(room, gain=1.6, seed=50 + step))
    assert state.since is not None
    assert (state.since[:, :30] <= 5).mean() < 0.02

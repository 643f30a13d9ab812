"""Which track a place refers to."""

from __future__ import annotations

import numpy as np

from tracker.corrections import Place
from tracker.corrections.finished_tracks import relabel
from tracker.corrections.kinds import make
from tracker.corrections.lookup import TrackIndex
from tracker.corrections.outcomes import outcomes


def walked() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Somebody who begins at step 3 and walks 0.5 m a step; somebody else who stands."""
    steps = np.array([*range(3, 9), *range(9)])
    owners = np.array([7] * 6 + [8] * 9)
    x = np.array([*(0.5 * step for step in range(3, 9)), *([1.55] * 9)])
    return steps, np.column_stack([x, np.zeros(15), np.ones(15)]), owners


def test_who_is_not_there_yet_is_meant_where_he_comes_from() -> None:
    steps, positions, owners = walked()
    whereabouts = TrackIndex(steps, positions, owners)

    def meant(step: int, x: float) -> int:
        row = whereabouts.nearest(Place(step, x, 0.0, 1.0), leeway=2)
        return -1 if row is None else int(owners[row])

    assert meant(2, 1.0) == 7  # half a metre before his first place, and 0.55 m from the other
    assert meant(2, 1.4) == 8
    assert meant(9, 4.5) == 7
    assert meant(9, 3.0) == -1
    assert meant(5, 2.5) == 7
    assert meant(5, 1.5) == 8


def test_a_correction_of_a_moment_before_somebody_begins_is_met() -> None:
    steps, positions, owners = walked()
    said = make(kind="same", places=[(2, 1.0, 0.0, 1.0), (6, 3.0, 0.0, 1.0)])
    found = outcomes(steps, owners, positions, (said,), leeway=2)
    assert found[0].met
    assert found[0].tracks == (7, 7)


def test_who_begins_at_the_last_step_of_nobody_is_somebody() -> None:
    steps = np.arange(40, 100)
    ids = np.ones(60, dtype=np.int64)
    where = np.column_stack([np.linspace(0.0, 5.0, 60), np.zeros(60), np.ones(60)])
    until = make(kind="nobody", places=[[0, 0.0, 0.0, 1.0], [40, 0.0, 0.0, 1.0]])
    (told,) = outcomes(steps, ids, where, [until], leeway=25)
    assert told.met, told.why
    assert len(relabel(steps, ids, where, [until], leeway=25)[1]) == 60
    at_once = make(kind="nobody", places=[[40, 0.0, 0.0, 1.0]])
    assert not outcomes(steps, ids, where, [at_once], leeway=25)[0].met
    (short,) = outcomes(steps[:1], ids[:1], where[:1], [until], leeway=25)
    assert not short.met

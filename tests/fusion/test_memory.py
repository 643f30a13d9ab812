"""Who is lost and who returns: one label one person, whoever left or came."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray

from tests.fusion.rooms import empty_room
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.memory import Memory, recall
from tracker.fusion.model import FusionModel
from tracker.parameters.groups.fusion import FusionParams

MODEL = FusionModel(empty_room(), FusionParams())


def people(*who: tuple[int, float, float, float]) -> GaussianMixture:
    """Label, weight, x and y of each."""
    count = len(who)
    means = np.zeros((count, 6))
    means[:, 0], means[:, 1], means[:, 2] = [w[2] for w in who], [w[3] for w in who], 0.85
    covariances = np.tile(np.diag([0.01, 0.01, 0.01, 0.1, 0.1, 0.01]), (count, 1, 1))
    return GaussianMixture(
        np.array([w[1] for w in who]), means, covariances, np.array([w[0] for w in who], dtype=int)
    )


def run(*steps: GaussianMixture) -> tuple[ndarray, Memory]:
    """Labels of the last step, when each step gives labels from 10 times its number on."""
    memory, labels = Memory.start(6), np.zeros(0, dtype=int)
    for number, step in enumerate(steps):
        labels, memory = recall(memory, step, MODEL, 10 * number)
    return labels, memory


NOBODY = people()


def test_the_faint_rest_of_the_old_label_goes_on_under_the_new_one() -> None:
    labels, _ = run(people((1, 0.9, 0.0, 0.0)), people((11, 0.9, 0.1, 0.0), (1, 0.2, 0.3, 0.0)))
    assert labels.tolist() == [1, 11], "no label twice"


def test_who_left_the_room_is_not_waited_for() -> None:
    away = people((1, 0.9, 2.15, 0.0))
    away.means[0, 3] = 1.0  # walking out
    _, memory = run(away, NOBODY, NOBODY)
    assert memory.lost.size == 0


def test_two_who_return_together_each_get_the_nearer_name() -> None:
    labels, _ = run(
        people((1, 0.9, 0.0, 0.0), (2, 0.9, 0.6, 0.0)),
        NOBODY,
        people((21, 0.9, 0.58, 0.0), (22, 0.9, 0.02, 0.0)),
    )
    assert labels.tolist() == [2, 1]


def test_without_a_memory_nothing_is_renamed() -> None:
    model = FusionModel(empty_room(), FusionParams().model_copy(update={"memory": 0.0}))
    memory = Memory.start(6)
    for step in (people((1, 0.9, 0.0, 0.0)), NOBODY):
        _, memory = recall(memory, step, model, 10)
    labels, memory = recall(memory, people((21, 0.9, 0.0, 0.0)), model, 20)
    assert labels.tolist() == [21]


@pytest.mark.parametrize("seed", range(5))
def test_labels_stay_unique(seed: int) -> None:
    rng = np.random.default_rng(seed)
    memory, label = Memory.start(6), 1
    alive: list[int] = []
    for _ in range(60):
        first = label
        if rng.random() < 0.4:
            alive.append(label)
            label += 1
        alive = [name for name in alive if rng.random() < 0.9]
        step = people(*[(n, float(rng.uniform(0.2, 1)), *rng.uniform(-1, 1, 2)) for n in alive])
        labels, memory = recall(memory, step, MODEL, first)
        assert len(set(labels.tolist())) == len(labels)
        alive = labels.tolist()

"""One label one person, whoever left or came: by place, and by looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tests.fusion.rooms import NO_BOXES, Step, empty_room, exact, filtered
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import reidentification
from tracker.fusion.memory import Memory, recall
from tracker.fusion.model import FusionModel
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.fusion.protocol import Associations
from tracker.fusion.reidentification import IdentityBeliefs, appearance_ratios, reidentify
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult

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


NO_TRACKS = np.zeros(0, dtype=np.int64)


def step(
    names: IdentityBeliefs,
    labels: list[int],
    looks: list[list[float]],
    seconds: float = 0.2,
    weight: float = 0.99,
) -> tuple[dict[int, int], IdentityBeliefs]:
    """One camera sees one box of each track, with these likenesses."""
    count = len(labels)
    boxes = np.ones((count, 4))
    view = ViewResult.of_boxes(boxes, np.ones(count), boxes)
    people = len(looks[0]) if looks else 2
    view = replace(view, likenesses=np.array(looks).reshape(count, people))
    posterior = GaussianMixture(
        np.full(count, weight), np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)),
        np.array(labels, dtype=np.int64),
    )  # fmt: skip
    own = np.arange(count, dtype=np.int32)
    pairs = Associations(np.zeros(count, dtype=np.int32), own, own, np.ones(count, np.float32))
    return reidentify(names, posterior, pairs, [view], NO_TRACKS, seconds)


@pytest.mark.parametrize("interval", [0.5, 2.0])
def test_the_boxes_of_an_interval_count_as_one(interval: float) -> None:
    """After a step of a tenth of a second the odds are those of one box to the power of its share
    of the interval."""
    view = ViewResult.of_boxes(np.ones((1, 4)), np.ones(1), np.ones((1, 4)))
    view = replace(view, likenesses=np.array([[0.9, 0.1]]))
    own = np.zeros(1, dtype=np.int32)
    pair = Associations(own, own, own, np.ones(1, np.float32))
    parameters = FusionParams(recognition_interval=interval)
    _, beliefs = reidentify(
        IdentityBeliefs.none(),
        people((1, 0.99, 0.0, 0.0)),
        pair,
        [view],
        NO_TRACKS,
        0.1,
        parameters,
    )
    outliers = parameters.recognition_outlier_probability
    odds = np.log((1.0 - outliers) * 0.9 + outliers / 2.0)
    odds -= np.log((1.0 - outliers) * 0.1 + outliers / 2.0)
    (one,) = beliefs.log_beliefs
    assert one[0] - one[1] == pytest.approx(0.1 / interval * odds)


def watched(
    names: IdentityBeliefs,
    labels: list[int],
    looks: list[list[float]],
    steps: int,
    weight: float = 0.99,
) -> IdentityBeliefs:
    """Many steps in which no label changes."""
    for _ in range(steps):
        renamed, names = step(names, labels, looks, weight=weight)
        assert renamed == {}
    return names


FIRST, SECOND, EITHER = [0.95, 0.05], [0.05, 0.95], [0.5, 0.5]


@pytest.mark.parametrize(("weight", "owners"), [(0.5, [-1, -1]), (0.5 + 1e-9, [1, 2])])
def test_a_track_is_named_once_it_is_likelier_than_not(weight: float, owners: list[int]) -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 30, weight)
    assert names.owners.tolist() == owners


def test_who_returns_after_long_absence_gets_his_label_back_once_it_is_sure() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 30)
    assert names.owners.tolist() == [1, 2]
    names = watched(names, [2], [SECOND], 300)
    renamed, names = step(names, [2, 7], [SECOND, FIRST])
    assert renamed == {}, "a fifth of a second is not enough to be sure"
    for _ in range(20):
        renamed, names = step(names, [2, 7], [SECOND, FIRST])
        if renamed:
            break
    assert renamed == {7: 1}


def test_a_stranger_is_not_named_by_exclusion() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 30)
    names = watched(names, [2], [SECOND], 20)
    watched(names, [2, 7], [SECOND, EITHER], 100)


def test_two_tracks_that_were_exchanged_are_exchanged_back() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 20)
    renamed: dict[int, int] = {}
    for _ in range(60):
        renamed, names = step(names, [1, 2], [SECOND, FIRST])
        if renamed:
            break
    assert renamed == {1: 2, 2: 1}
    watched(names, [2, 1], [SECOND, FIRST], 40)


def test_who_is_known_by_his_colours_is_likelier_to_make_a_box_that_has_them() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 40)
    view = ViewResult.of_boxes(np.ones((3, 4)), np.ones(3), np.ones((3, 4)))
    view = replace(view, likenesses=np.array([FIRST, SECOND, EITHER]))
    alike = appearance_ratios(names, np.array([2, 1, 9]), [view, view])
    assert alike.shape == (3, 6)
    own = np.exp(names.log_beliefs[1]) / np.exp(names.log_beliefs[1]).sum()
    assert alike[0, :3] == pytest.approx(
        [0.5 + 1.0 * own @ seen for seen in (FIRST, SECOND, EITHER)]
    )
    assert alike[0, 1] > 1.3
    assert alike[0, 0] < 0.7
    assert alike[1, 0] > 1.3
    assert alike[2] == pytest.approx(1.0), "nothing is known of a newcomer"
    assert alike[:, 2] == pytest.approx(1.0), "nor of a box that has anybody's colours"


def test_without_pictures_nobody_is_known_by_looks() -> None:
    view = ViewResult.of_boxes(np.ones((2, 4)), np.ones(2), np.ones((2, 4)))
    assert appearance_ratios(IdentityBeliefs.none(), np.array([1]), [view]).shape == (0, 2)
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 20)
    assert appearance_ratios(names, np.array([1, 2]), [view]) == pytest.approx(1.0)


def test_people_who_look_alike_keep_their_labels() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [EITHER, EITHER], 200)
    assert names.owners.tolist() == [-1, -1]


def test_of_two_tracks_that_look_like_one_person_neither_is_named() -> None:
    beliefs = np.log([[0.99, 0.01], [0.99, 0.01], [0.01, 0.99]])
    found = reidentification._recognise(beliefs, own=np.log(9.0), odds=np.log(9.0))
    assert found == [(2, 1)]


def test_a_track_is_named_once_the_odds_are_twenty_to_one() -> None:
    names, named = IdentityBeliefs.none(), []
    for _ in range(12):
        _, names = step(names, [1], [FIRST])
        named.append(bool(names.owners[0] == 1))
        assert named[-1] == (np.ptp(names.log_beliefs[0]) > np.log(20.0))
    assert named == sorted(named)
    assert 3 < sum(named) < 9


def test_looks_that_nobody_renews_are_forgotten_at_the_rate_of_the_leak() -> None:
    names = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 30)

    def share() -> float:
        """π of the first person in the first track's looks."""
        chances = np.exp(names.log_beliefs[names.labels.tolist().index(1)])
        return float(chances[0] / chances.sum())

    begin, seconds, steps = share(), 0.2, 40
    assert begin > 0.9
    names = watched(names, [1, 2], [EITHER, EITHER], steps)
    # π − 1/G shrinks by 1 − Δt/T a step, T = 30 s
    assert share() - 0.5 == pytest.approx((begin - 0.5) * (1.0 - seconds / 30.0) ** steps)


def test_no_evidence_lasts_for_ever() -> None:
    soon = watched(IdentityBeliefs.none(), [1, 2], [FIRST, SECOND], 200)
    late = watched(soon, [1, 2], [FIRST, SECOND], 400)
    odds = [float(np.ptp(names.log_beliefs[0])) for names in (soon, late)]
    assert odds[1] == pytest.approx(odds[0], abs=0.01)
    assert odds[1] < 10.0


def test_pictures_of_one_moment_count_as_one_look() -> None:
    odds = []
    for seconds in (0.02, 0.1):
        names = IdentityBeliefs.none()
        for _ in range(round(1.0 / seconds)):
            _, names = step(names, [1, 2], [FIRST, SECOND], seconds)
        odds.append(float(np.ptp(names.log_beliefs[0])))
    assert odds[0] == pytest.approx(odds[1], rel=0.03), "the frame rate makes nobody surer"


def test_without_two_people_to_tell_apart_nothing_is_done() -> None:
    for looks in ([[1.0], [1.0]], [[], []]):
        renamed, names = step(IdentityBeliefs.none(), [1, 2], looks)
        assert renamed == {}
        assert len(names.labels) == 0


@given(st.integers(0, 10_000))
def test_labels_stay_unique_and_what_is_kept_is_bounded(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names, labels, free = IdentityBeliefs.none(), [1, 2, 3], 4
    for _ in range(25):
        looks = rng.dirichlet([0.3, 0.3, 0.3], len(labels)).tolist()
        renamed, names = step(names, labels, looks, seconds=0.5)
        labels = [renamed.get(label, label) for label in labels]
        assert len(set(labels)) == len(labels)
        assert len(names.labels) == len(labels)
        owned = names.owners[names.owners >= 0].tolist()
        assert len(set(owned)) == len(owned)
        if rng.random() < 0.2:
            labels[int(rng.integers(3))], free = free, free + 1


@pytest.mark.parametrize("recognition", [True, False])
def test_recognition_gives_the_label_back_at_another_place_and_can_be_switched_off(
    recognition: bool,
) -> None:
    """Two seconds here, a second away, two seconds two metres off."""

    def seen(place: list[float]) -> tuple[ViewResult, ...]:
        return tuple(
            replace(view, likenesses=np.tile([0.9, 0.1], (len(view.boxes), 1)))
            for view in exact([place])
        )

    views = [seen([-0.8, -0.5, 0.85])] * 20 + [(NO_BOXES,) * 4] * 10 + [seen([1.2, 0.5, 0.85])] * 20
    results = filtered(MultiBernoulli, views, recognition=recognition, memory=0.0)
    labels = [
        int(results[step].posterior.labels[results[step].posterior.weights.argmax()])
        for step in (19, -1)
    ]
    assert (labels[0] == labels[1]) is recognition


@pytest.mark.parametrize("recognition", [True, False])
def test_a_box_between_two_tracks_is_the_one_s_whose_colours_it_has(recognition: bool) -> None:
    """One camera shows one of two people, half way between them."""

    def coloured(views: Step, likenesses: list[list[float]]) -> Step:
        return tuple(replace(view, likenesses=np.array(likenesses)) for view in views)

    both = coloured(exact([[-0.4, 0.0, 0.85], [0.4, 0.0, 0.85]]), [[0.9, 0.1], [0.1, 0.9]])

    def shares(likeness: list[float]) -> ndarray:
        """The association probabilities of the two people and the box."""
        middle = coloured(exact([[0.0, 0.0, 0.85]])[:1], [likeness])
        views = [both] * 20 + [middle + (NO_BOXES,) * 3]
        results = filtered(MultiBernoulli, views, recognition=recognition, measurement_sigma=20.0)
        result = results[-1]
        found = np.zeros(2)
        person = (result.posterior.means[result.associations.components, 0] > 0.0).astype(int)
        np.add.at(found, person, result.associations.probabilities)
        return found

    first, second = shares([0.9, 0.1]), shares([0.1, 0.9])
    if recognition:
        own, other = np.array([first[0], second[1]]), np.array([second[0], first[1]])
        assert (own / (1.0 - own) > 2.0 * other / (1.0 - other)).all()
        assert (other > 0.0).all()
    else:
        np.testing.assert_array_equal(first, second)

"""A camera without a frame says nothing: no miss, no lower existence, and yet births."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.random_rooms import random_room
from tracker import fusion, pipeline
from tracker.parameters import RunParameters, with_values
from tracker.runs.run import Run
from tracker.sequences.clock import Timing
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

METHODS = ["multi_bernoulli", "sequential_phd"]
every_method = pytest.mark.parametrize("method", METHODS)


def parameters(method: str) -> RunParameters:
    """For boxes as they are."""
    return with_values(RunParameters(single_view="none"), {"fusion_method": method})


def slowed(sequence: Sequence, every: dict[int, tuple[int, int]]) -> Sequence:
    """The same where some cameras have a frame only at every n-th step, from one on."""
    views = list(sequence.views)
    for camera, (n, first) in every.items():
        own = views[camera].detections
        assert own is not None
        there = np.arange(sequence.frames) % n == first
        kept = there[own.frames]
        boxes = replace(
            own, frames=own.frames[kept], boxes=own.boxes[kept], scores=own.scores[kept]
        )
        views[camera] = replace(views[camera], detections=boxes, looked_at=there)
    return replace(sequence, views=tuple(views), digest=f"{sequence.digest}-{every}")


def run(sequence: Sequence, method: str) -> Run:
    """The whole run."""
    return pipeline.compute(sequence, parameters(method))


def found_share(sequence: Sequence, made: Run) -> float:
    """The share of people's steps with a track within half a metre, after the first second."""
    truth = sequence.ground_truth
    assert truth is not None
    hits, count = 0, 0
    for frame in range(int(sequence.fps), sequence.frames):
        tracks = made.tracks.positions[made.tracks.frames == frame]
        for place in truth.positions[truth.at(frame)]:
            if sum(camera.sees(place[None])[0] for camera in sequence.cameras) < 2:
                continue
            count += 1
            hits += bool((np.linalg.norm(tracks - place, axis=1) < 0.5).any()) if len(tracks) else 0
    return hits / count


@every_method
def test_nobody_is_less_likely_to_exist_for_a_frame_that_is_not_there(method: str) -> None:
    sequence = random_room(1, cameras=3, people=2, steps=40)
    made = run(sequence, method)
    process = fusion.create(sequence, made.parameters)
    state = process.start()
    for views in made.views[:30]:
        state, before = process.step(state, views)
    nothing = tuple(ViewResult.of_no_frame() for _ in sequence.views)
    _, after = process.step(state, nothing)
    survival = made.parameters.fusion.survival_probability
    sure = before.posterior.weights > 0.9
    assert sure.sum() >= 1
    for label, weight in zip(
        before.posterior.labels[sure], before.posterior.weights[sure], strict=True
    ):
        now = after.posterior.weights[after.posterior.labels == label].sum()
        assert now >= survival * weight - 1e-9
    assert not after.detection_probabilities.any()
    assert (after.sources == -1).all()


@every_method
def test_where_every_frame_is_there_nothing_changes(method: str) -> None:
    sequence = random_room(3, cameras=3, people=3, steps=30)
    always = slowed(sequence, {0: (1, 0)})
    for a, b in zip(run(sequence, method).fused, run(always, method).fused, strict=True):
        assert_array_equal(a.posterior.weights, b.posterior.weights)
        assert_array_equal(a.posterior.means, b.posterior.means)


@pytest.mark.parametrize("seed", range(3))
def test_cameras_of_other_rates_keep_the_tracks(seed: int) -> None:
    """One camera at full rate, one at half, one at a third of it."""
    sequence = random_room(seed, cameras=3, people=3, steps=150, fps=25.0)
    share = found_share(sequence, run(sequence, "multi_bernoulli"))
    slow = slowed(sequence, {1: (2, 1), 2: (3, 2)})
    assert found_share(sequence, run(slow, "multi_bernoulli")) > share - 0.1


@pytest.mark.parametrize("seed", range(3))
def test_cameras_that_take_turns_begin_tracks_together(seed: int) -> None:
    """No two cameras ever have a frame at the same step."""
    sequence = random_room(seed, cameras=2, people=2, steps=150, fps=20.0)
    turns = slowed(sequence, {0: (2, 0), 1: (2, 1)})
    made = run(turns, "multi_bernoulli")
    both = run(sequence, "multi_bernoulli")
    assert found_share(turns, made) > found_share(sequence, both) - 0.15
    for views, result in zip(made.views, made.fused, strict=True):
        for camera, view in enumerate(views):
            assert (result.sources[camera] < len(view.boxes)).all()


def test_boxes_further_apart_than_a_moment_begin_nobody() -> None:
    sequence = random_room(0, cameras=2, people=2, steps=60, fps=20.0)
    turns = slowed(sequence, {0: (10, 0), 1: (10, 5)})
    alone = with_values(parameters("multi_bernoulli"), {"fusion.birth": "measurements"})
    assert not len(pipeline.compute(turns, alone).tracks.frames)
    nearer = slowed(sequence, {0: (10, 0), 1: (10, 4)})
    assert len(pipeline.compute(nearer, alone).tracks.frames)


def test_a_clock_of_its_own_is_a_camera_with_fewer_frames() -> None:
    clock = Timing(fps=10.0).clock(20.0, 40)
    assert clock is not None
    assert ((clock.frame_of_step >= 0) == (np.arange(40) % 2 == 0)).all()

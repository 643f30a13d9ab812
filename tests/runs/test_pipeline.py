"""The pipeline: complete, repeatable, resumable, and re-using what a change leaves standing."""

from __future__ import annotations

import threading
from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.engine.painted import RED, painted_sequence
from tests.engine.synthetic import CAMERAS, crossing, sequence
from tests.runs.test_steps import same
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled, Progress, Run, compute, default_parameters, stage_keys
from tracker.runs.stage_cache import StageCache
from tracker.sequences.pictures.frames import FrameReader, Picture
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view.protocol import ViewResult
from tracker.steps import steps as stored

STEPS = 60
COLOUR = with_values(RunParameters(), {"single_view": "colour_phd"})
WHOLE = sequence(crossing(STEPS), STEPS, clutter_rate=0.5)
BOXES = RunParameters(
    single_view="none", fusion_method="sequential_phd", smoothing_method="identities"
)


@pytest.fixture(autouse=True)
def _told_after_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "PROGRESS_SECONDS", 0.0)


@pytest.fixture(autouse=True)
def _stored_in_several_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored, "BLOCK", 8)


def changed(**values: object) -> RunParameters:
    """Boxes as they are, with some values of the fusion changed."""
    return with_values(BOXES, {f"fusion.{name}": value for name, value in values.items()})


def assert_same_tracks(a: Trajectories, b: Trajectories) -> None:
    """Every column equal."""
    for name in Trajectories.__slots__:
        assert_array_equal(getattr(a, name), getattr(b, name))


def taken_over(those: Many[Any], of: Many[Any]) -> bool:
    """Whether results are those of another run, not as many that were computed again."""
    pairs = [
        (one.posterior.means, other.posterior.means)
        if isinstance(one, FusionResult)
        else (one[0].boxes, other[0].boxes)
        for one, other in zip(those, of, strict=False)
    ]
    assert any(len(one) for one, _ in pairs)
    return all(np.shares_memory(one, other) for one, other in pairs if len(one))


def assert_same(a: Run, b: Run) -> None:
    """The same columns to the last bit."""
    assert (a.done, a.keys) == (b.done, b.keys)
    assert len(a.views) == len(b.views)
    for one, other in zip(a.views, b.views, strict=True):
        for first, second in zip(one, other, strict=True):
            for field in fields(ViewResult):
                assert same(getattr(first, field.name), getattr(second, field.name)), field.name
    for here, there in zip(a.fused, b.fused, strict=True):
        for name in ("weights", "means", "covariances", "labels"):
            assert_array_equal(getattr(here.posterior, name), getattr(there.posterior, name))
        for name in ("detection_probabilities", "sources", "source_weights", "hidden_by"):
            assert_array_equal(getattr(here, name), getattr(there, name))
    assert_same_tracks(a.tracks, b.tracks)


class Stopper:
    """Cancels once a number of steps is done, and keeps the run that it saw."""

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self.run: Run | None = None

    def on_progress(self, run: Run, progress: Progress) -> None:
        """Told by the pipeline."""
        self.run = run

    def cancelled(self) -> bool:
        """Asked by the pipeline."""
        return self.run is not None and self.run.done >= self._steps


def stopped(
    parameters: RunParameters, steps: int, *, previous: Run | None = None, whole: Sequence = WHOLE
) -> Run:
    """A run that was cancelled after some steps."""
    stopper = Stopper(steps)
    with pytest.raises(Cancelled):
        compute(
            whole,
            parameters,
            previous=previous,
            on_progress=stopper.on_progress,
            cancelled=stopper.cancelled,
        )
    assert stopper.run is not None
    return stopper.run


def test_a_run_fills_every_column() -> None:
    run = compute(WHOLE, BOXES)
    assert run.complete
    assert run.done == len(run.views) == len(run.fused) == STEPS
    assert all(len(views) == len(CAMERAS) for views in run.views)
    assert set(run.tracks.ids.tolist()) == {1, 2}
    assert run.tracks.seen.shape == (len(run.tracks), len(CAMERAS))
    for frame in range(5, STEPS):
        rows = run.tracks.at(frame)
        truth = WHOLE.ground_truth
        assert truth is not None
        places = truth.positions[truth.at(frame)]
        gaps = np.linalg.norm(run.tracks.positions[rows][:, None] - places, axis=2)
        assert gaps.shape == (2, 2)
        assert gaps.min(axis=0).max() < 0.15


def test_the_same_seed_gives_the_same_run() -> None:
    assert_same(compute(WHOLE, BOXES, seed=3), compute(WHOLE, BOXES, seed=3))
    assert compute(WHOLE, BOXES, seed=4).key != compute(WHOLE, BOXES, seed=3).key


@pytest.mark.parametrize("steps", [0, 1, 4, 5, 17, STEPS - 1])
def test_resuming_gives_the_same_columns_as_one_go(steps: int) -> None:
    partial = stopped(BOXES, steps)
    assert partial.done == steps
    before = (list(partial.views), list(partial.fused), partial.done)
    resumed = compute(WHOLE, BOXES, previous=partial)
    assert_same(resumed, compute(WHOLE, BOXES))
    assert same(resumed.fused[:steps], before[1])
    after = (list(partial.views), list(partial.fused), partial.done)
    assert same(after, before), "it is left as it was"


def test_a_run_may_be_stopped_and_resumed_many_times() -> None:
    run: Run | None = None
    for steps in range(7, STEPS, 13):
        run = stopped(BOXES, steps, previous=run)
    assert_same(compute(WHOLE, BOXES, previous=run), compute(WHOLE, BOXES))


def test_what_was_seen_of_a_stopped_run_is_the_beginning_of_the_whole() -> None:
    partial, whole = stopped(BOXES, 30), compute(WHOLE, BOXES)
    rows = whole.filtered.frames < partial.done
    for name in set(Trajectories.__slots__) - {"sigmas"}:  # which are provisional until the end
        assert_array_equal(getattr(partial.tracks, name), getattr(whole.filtered, name)[rows])
    assert (partial.tracks.sigmas[:, :2] < whole.filtered.sigmas[rows, :2]).all()
    assert not partial.complete


def test_a_changed_extraction_threshold_reruns_no_filter() -> None:
    # who is hidden in the last camera keeps a weight of about 1 - p_D
    whole = sequence(crossing(STEPS), STEPS, hidden=[(2, 0, range(30, 40))])
    first = compute(whole, changed(misses="per_camera"))
    parameters = changed(misses="per_camera", extraction_threshold=0.01)
    second = compute(whole, parameters, previous=first)
    assert taken_over(second.fused, first.fused)
    assert taken_over(second.views, first.views)
    assert_same(second, compute(whole, parameters))
    assert len(second.filtered) >= len(first.filtered) + 10


def test_a_changed_fusion_reuses_the_views() -> None:
    first = compute(WHOLE, BOXES)
    parameters = changed(survival_probability=0.9)
    second = compute(WHOLE, parameters, previous=first)
    assert taken_over(second.views, first.views)
    assert not taken_over(second.fused, first.fused)
    assert_same(second, compute(WHOLE, parameters))


def test_a_changed_view_reuses_nothing() -> None:
    first = compute(WHOLE, BOXES)
    parameters = with_values(BOXES, {"detection_boxes.centre_sigma": 0.1})
    second = compute(WHOLE, parameters, previous=first)
    assert not taken_over(second.views, first.views)
    assert_same(second, compute(WHOLE, parameters))


def test_another_sequence_reuses_nothing() -> None:
    other = sequence(crossing(STEPS), STEPS, seed=1)
    first = compute(WHOLE, BOXES)
    assert_same(compute(other, BOXES, previous=first), compute(other, BOXES))


def test_columns_of_different_length_are_resumed_where_each_ends() -> None:
    views_only = stopped(BOXES, 40)
    parameters = changed(clutter_rate=2.0)
    both = stopped(parameters, 20, previous=views_only)
    assert len(both.views) >= 40
    assert len(both.fused) == 20
    resumed = compute(WHOLE, parameters, previous=both)
    assert taken_over(resumed.views[:40], views_only.views)
    assert taken_over(resumed.fused[:16], both.fused)  # those in blocks
    assert_same(resumed, compute(WHOLE, parameters))
    # and back again: what is left of the first run still holds
    assert_same(compute(WHOLE, BOXES, previous=views_only), compute(WHOLE, BOXES))


@pytest.mark.parametrize(
    ("earlier", "stage", "fresh"),
    [
        (None, "single_view", STEPS),
        (changed(survival_probability=0.9), "fusion", STEPS),
        (changed(extraction_threshold=0.7), "tracks", 0),
        (BOXES, "tracks", 0),
    ],
)
def test_progress_only_grows(earlier: RunParameters | None, stage: str, fresh: int) -> None:
    told: list[Progress] = []

    def note(run: Run, progress: Progress) -> None:
        assert run.done == progress.done <= len(run.fused)
        assert len(run.tracks) == 0 or run.tracks.frames.max() < run.done
        told.append(progress)

    previous = compute(WHOLE, earlier) if earlier is not None else None
    compute(WHOLE, BOXES, previous=previous, on_progress=note)
    stages = list(dict.fromkeys(progress.stage for progress in told))
    assert stages[0] == stage
    assert stages[-1] == ("tracks" if stage == "tracks" else "smoothing")
    assert len(stages) <= 2
    assert {progress.total for progress in told} == {STEPS}
    done, seconds = [p.done for p in told], [p.seconds for p in told]
    assert done == sorted(done)
    assert seconds == sorted(seconds)
    assert told[-1].done == STEPS
    assert told[-1].fresh == fresh
    assert told[0].seconds_left is None
    if fresh:
        assert told[-1].seconds_left == 0.0
        assert told[-1].steps_per_second > 0.0
        assert all(p.seconds_left is not None and p.seconds_left >= 0.0 for p in told[1:])


def test_the_preparation_does_not_count_as_slowness() -> None:
    early = Progress("single_view", done=1, total=101, seconds=50.0, fresh=1, preparing=50.0)
    later = Progress("single_view", done=21, total=101, seconds=52.0, fresh=21, preparing=50.0)
    assert early.steps_per_second == pytest.approx(1.0 / 50.0)
    assert later.steps_per_second == pytest.approx(10.0)
    assert later.seconds_left == pytest.approx(8.0)


def test_no_thread_outlives_a_run() -> None:
    def threads() -> list[str]:
        return [t.name for t in threading.enumerate() if t.name.startswith("single-view")]

    compute(WHOLE, BOXES)
    assert threads() == []
    stopped(BOXES, 10)
    assert threads() == []


def test_a_run_that_is_stopped_before_its_first_step_asks_for_no_more_pictures(
    tmp_path: Path,
) -> None:
    class Counting(FrameReader):
        asked = 0

        def picture(self, camera: int, step: int) -> Picture | None:
            self.asked += 1
            return super().picture(camera, step)

    path = np.linspace([-0.8, 0.2, 1.0], [0.8, 0.2, 1.0], 30)
    painted = painted_sequence(tmp_path, [path], [RED])
    kept = StageCache()
    with Counting(painted) as reader:
        with pytest.raises(Cancelled):
            compute(painted, COLOUR, reader=reader, cache=kept, cancelled=lambda: reader.asked >= 3)
        assert reader.asked == 3
        # what was broken off is made whole by the next run
        assert len(compute(painted, COLOUR, reader=reader, cache=kept, steps=2).views) >= 2
        assert reader.asked > 3


def test_threads_of_cameras_begin_as_they_are_told() -> None:
    begun: list[str] = []
    compute(
        WHOLE, BOXES, steps=2, thread_begins=lambda: begun.append(threading.current_thread().name)
    )
    assert len(begun) == len(CAMERAS)
    assert all(name.startswith("single-view") for name in begun)


@pytest.mark.parametrize("raised_by", ["progress", "cancelled"])
def test_an_error_of_the_caller_comes_out_and_ends_the_run(raised_by: str) -> None:
    def fail(*_: object) -> bool:
        raise RuntimeError("the caller's own")

    on_progress: Callable[[Run, Progress], None] | None = None
    cancelled: Callable[[], bool] = lambda: False  # noqa: E731
    if raised_by == "progress":
        on_progress = fail  # type: ignore[assignment]
    else:
        cancelled = fail
    with pytest.raises(RuntimeError, match="the caller's own"):
        compute(WHOLE, BOXES, on_progress=on_progress, cancelled=cancelled)
    assert not [t for t in threading.enumerate() if t.name.startswith("single-view")]


def test_one_step_is_a_sequence_too() -> None:
    run = compute(sequence(crossing(2), 1), BOXES)
    assert run.complete
    assert len(run.fused) == 1


def test_the_keys_follow_the_stages() -> None:
    keys = stage_keys(WHOLE, BOXES, 0)
    tracks = stage_keys(WHOLE, changed(extraction_threshold=0.7), 0)
    smoothing = stage_keys(WHOLE, with_values(BOXES, {"smoothing.jump": 50.0}), 0)
    fusion = stage_keys(WHOLE, changed(clutter_rate=2.0), 0)
    views = stage_keys(WHOLE, with_values(BOXES, {"detection_boxes.size_sigma": 0.3}), 0)
    seed = stage_keys(WHOLE, BOXES, 1)
    digest = stage_keys(replace(WHOLE, digest="other"), BOXES, 0)
    for other, stages in (
        (tracks, {"single_view", "fusion", "smoothing"}),
        (smoothing, {"single_view", "fusion"}),
        (fusion, {"single_view"}),
        (views, set()),
        (seed, set()),
        (digest, set()),
    ):
        assert {stage for stage in keys if keys[stage] == other[stage]} == stages
    # a parameter of a method that is not in use changes nothing
    unused = with_values(BOXES, {"colour_phd.survival_probability": 0.8})
    assert stage_keys(WHOLE, unused, 0) == keys


def test_the_methods_follow_from_what_the_sequence_has() -> None:
    filmed = replace(
        WHOLE,
        views=tuple(replace(view, video=Path("v.avi"), detections=None) for view in WHOLE.views),
    )
    template = Template("person", "left", 0, np.array([1.0, 2.0, 3.0, 4.0]))
    assert default_parameters(WHOLE).single_view == "none"
    assert default_parameters(filmed).single_view == "shapes"
    both = replace(
        WHOLE,
        views=tuple(replace(view, video=Path("v.avi")) for view in WHOLE.views),
        templates=(template,),
    )
    assert default_parameters(both).single_view == "colour_phd"
    assert default_parameters(replace(both, templates=())).single_view == "none"
    bare = replace(WHOLE, views=tuple(replace(view, detections=None) for view in WHOLE.views))
    with pytest.raises(
        ValueError, match=r"synthetic: every camera needs pictures .*sequence\.toml"
    ):
        default_parameters(bare)


def test_a_method_that_does_not_fit_the_sequence_is_told_by_camera() -> None:
    views = (WHOLE.views[0], replace(WHOLE.views[1], detections=None), WHOLE.views[2])
    with pytest.raises(ValueError, match='camera "right" of synthetic has no detections'):
        compute(replace(WHOLE, views=views), BOXES)


def test_the_filters_people_are_told_first_and_the_smoothed_ones_take_their_place() -> None:
    told: list[tuple[int, bool, Trajectories]] = []

    def on_progress(run: Run, progress: Progress) -> None:
        told.append((progress.done, run.smoothed is not None, run.tracks))

    run = compute(WHOLE, BOXES, on_progress=on_progress)
    plain = compute(WHOLE, with_values(BOXES, {"smoothing_method": "none"}))
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    before = [tracks for done, smoothed, tracks in told if done == STEPS and not smoothed]
    assert_same_tracks(before[-1], plain.tracks)
    assert told[-1][1]
    assert told[-1][2] is run.tracks
    assert run.smoothed is not None
    sigmas = np.sqrt(plain.tracks.sigmas**2 + run.smoothed.common * np.array([1.0, 1.0, 0.0]))
    assert run.smoothed.common > 0.0
    assert_same_tracks(run.filtered, replace(plain.tracks, sigmas=sigmas))
    assert plain.filtered is plain.tracks
    assert plain.smoothed is None
    assert set(run.tracks.ids.tolist()) <= set(run.filtered.ids.tolist())


def test_another_smoothing_reruns_no_filter() -> None:
    first = compute(WHOLE, BOXES)
    parameters = with_values(BOXES, {"smoothing_method": "positions"})
    second = compute(WHOLE, parameters, previous=first)
    assert taken_over(second.fused, first.fused)
    assert second.smoothed is not first.smoothed
    assert_same(second, compute(WHOLE, parameters))
    threshold = compute(WHOLE, changed(extraction_threshold=0.7), previous=first)
    assert threshold.smoothed is first.smoothed


def test_a_stop_while_it_smooths_keeps_what_the_filter_found() -> None:
    cache, asked = StageCache(), 0

    def cancelled() -> bool:
        return smoothing_begun

    smoothing_begun = False

    def on_progress(run: Run, progress: Progress) -> None:
        nonlocal smoothing_begun, asked
        if progress.done == STEPS:
            smoothing_begun = True
            asked += 1

    with pytest.raises(Cancelled):
        compute(WHOLE, BOXES, cache=cache, on_progress=on_progress, cancelled=cancelled)
    assert asked
    again = compute(WHOLE, BOXES, cache=cache)
    assert_same(again, compute(WHOLE, BOXES))

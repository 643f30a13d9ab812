"""The experiment on merging and splitting: its clips, its figures and its direction."""

from __future__ import annotations

import numpy as np
import pytest

from tests.papers.claims import association
from tests.papers.claims.association import compare
from tests.papers.clips.association import (
    CLIPS,
    FULL_LIGHT,
    SIZE,
    coming_and_going,
    light,
    together,
    true_mask,
)
from tests.papers.clips.clip import Actor, Clip, constant_size, wall
from tests.papers.clips.light import ADAPTIVE, ROBUST, FixedForeground, Light, models
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.protocol import ViewResult

WIDE, HIGH = 10.0, 20.0


def crossing() -> Clip:
    """Two pass each other at step 20, in one line."""
    steps = 41
    path = np.stack([np.linspace(40.0, 160.0, steps), np.full(steps, 60.0)], axis=1)
    size = constant_size(steps, WIDE, HIGH)
    colours = ((40.0, 40.0, 200.0),)
    return Clip("crossing", wall((200, 120)), (Actor("1", path, size, colours),
                Actor("2", path[::-1].copy(), size, colours)), np.ones(steps))  # fmt: skip


def result_of(boxes: list[list[float]], labels: list[int]) -> ViewResult:
    rows = np.array(boxes, dtype=float).reshape(-1, 4)
    empty = ViewResult.of_boxes(rows, np.ones(len(rows)), np.ones_like(rows))
    return ViewResult(
        **{name: getattr(empty, name) for name in empty.__slots__ if name != "estimate_labels"},
        estimate_labels=np.array(labels, dtype=np.int64),
    )


def perfect(clip: Clip, *, swapped_after: int = 1000, off: float = 0.0) -> list[ViewResult]:
    """Estimates at the true places, some pixels lower, with ids that swap at a step."""
    results = []
    for step in range(clip.steps):
        boxes = clip.boxes(step) + np.array([0.0, off, 0.0, 0.0])
        labels = [7, 9] if step <= swapped_after else [9, 7]
        results.append(result_of(boxes.tolist(), labels))
    return results


def test_the_clips_show_what_they_are_made_for() -> None:
    for name, make in CLIPS.items():
        clip, again, other = make(0), make(0), make(1)
        assert clip.size == SIZE
        np.testing.assert_array_equal(clip.actors[0].path, again.actors[0].path)
        assert not np.array_equal(clip.actors[0].path, other.actors[0].path)
        met = together(clip)
        assert met.any(axis=0).all(), name
        shares = np.array([clip.visible(step) for step in range(0, clip.steps, 3)])
        deepest = np.nanmin(np.where(met[::3], shares, np.nan))
        assert deepest > 0.6 if name == "passing" else deepest < 0.35, name
    assert CLIPS["street"](0).steps == len(light()) == 320
    assert np.all(light()[: FULL_LIGHT + 1] == 1.0)
    assert light().min() == 0.4


def test_together_are_those_whose_ellipses_are_near() -> None:
    clip = crossing()
    met = together(clip)
    apart = np.abs(clip.actors[0].path[:, 0] - clip.actors[1].path[:, 0])
    np.testing.assert_array_equal(met, np.tile((apart < 1.15 * 2 * WIDE)[:, None], 2))


def test_the_true_mask_is_what_the_renderer_paints() -> None:
    clip = coming_and_going(0)
    for step in (40, 120):
        painted = clip.picture(step).astype(float)
        empty = Clip("empty", clip.background, (), clip.light, seed=clip.seed).picture(step)
        differs = np.abs(painted - empty).max(axis=2) > 25.0
        mask = true_mask(clip, step)
        assert mask.sum() > 1000
        assert differs[mask].mean() > 0.9
        assert not differs[~mask].mean() > 0.002


def test_perfect_tracks_have_no_error_and_the_right_ids() -> None:
    clip = crossing()
    tracked = compare(clip, perfect(clip))
    assert tracked.partings == tracked.right == 2
    assert tracked.present.all()
    np.testing.assert_allclose(tracked.errors, 0.0, atol=1e-9)
    figures = association.summed_up([compare(clip, perfect(clip, off=3.0))])
    assert figures["alone"] == figures["merged"] == pytest.approx(3.0)
    assert figures["found"] == 1.0


def test_ids_that_swap_while_merged_are_wrong_after_the_parting() -> None:
    clip = crossing()
    tracked = compare(clip, perfect(clip, swapped_after=20))
    assert (tracked.partings, tracked.right) == (2, 0)
    # while merged everybody is the track that he was before
    assert np.nanmax(tracked.errors[tracked.merged]) > WIDE


def test_who_is_not_found_has_no_error_and_no_id() -> None:
    clip = crossing()
    results = [result_of([clip.boxes(step)[0].tolist()], [7]) for step in range(clip.steps)]
    tracked = compare(clip, results)
    assert (tracked.partings, tracked.right) == (2, 1)
    assert np.isnan(tracked.errors[:, 1]).all()
    assert association.summed_up([tracked])["found"] == pytest.approx(0.5)
    nothing = compare(clip, [result_of([], [])] * clip.steps)
    assert association.summed_up([nothing])["merged"] is None


def counts(f: float) -> np.ndarray:
    """Of 20 pictures with 100 pixels each: so many found that F is this, none false."""
    right = 100.0 * f / (2.0 - f)
    return np.tile([right, 0.0, 100.0 - right], (20, 1))


def test_light_is_judged_by_the_best_fixed_threshold() -> None:
    same = {name: counts(0.5) for name in models()}
    assert Light(same, 25.0).finding().verdict == "better"
    ahead = {**same, "fixed 30": counts(0.7)}
    finding = Light(ahead, 25.0).finding()
    assert finding.verdict == "worse"
    assert "30 grey levels" in finding.found
    figures = Light({**same, ADAPTIVE: counts(0.8)}, 25.0).figures(ADAPTIVE)
    assert figures["f"] == figures["worst"] == pytest.approx(0.8)
    assert figures["precision"] == 1.0
    empty = Light({name: np.zeros((20, 3)) for name in models()}, 25.0)
    assert np.all(empty.over_time(ROBUST) == 1.0)


def test_a_fixed_threshold_is_the_same_model_with_another_threshold() -> None:
    clip = coming_and_going(0)
    parameters = ForegroundParams(model="adaptive", least_threshold=0.0)
    model = FixedForeground(clip.picture(0), parameters, 33.0)
    _, found = model.step(model.start(), clip.picture(60))
    np.testing.assert_array_equal(found.thresholds, 33.0)

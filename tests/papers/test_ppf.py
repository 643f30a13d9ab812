"""The experiment on targets that look alike: its clips, its figures and its direction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.papers.claims import ppf
from tests.papers.claims.ppf import CLASSICAL, PSEUDO, Scene
from tests.papers.clips import clip as clips
from tests.papers.clips.clip import Clip
from tests.papers.clips.ppf import CLIPS, SHADE
from tracker.runs.processes import WorkerControl

NOBODY = WorkerControl(advance=lambda steps: None, cancelled=lambda: False)
BOX = [50.0, 60.0, 10.0, 14.0]


def shortened(clip: Clip, steps: int) -> Clip:
    actors = tuple(
        replace(actor, path=actor.path[:steps], half_sizes=actor.half_sizes[:steps])
        for actor in clip.actors
    )
    return replace(clip, actors=actors, light=clip.light[:steps])


def test_the_clips_show_what_they_are_named_after() -> None:
    cup, balls, faces = (make() for make in CLIPS.values())
    assert [clip.name for clip in (cup, balls, faces)] == list(CLIPS)
    assert [len(clip.actors) for clip in (cup, balls, faces)] == [1, 2, 3]
    for clip in (balls, faces):  # nothing but the place tells them apart
        assert len({(a.colours, a.seed, a.speckle) for a in clip.actors}) == 1
    apart = np.linalg.norm(balls.actors[0].path - balls.actors[1].path, axis=1) / 13.0
    assert apart.min() < 2.5
    visible = np.array([faces.visible(step) for step in range(80, 110)])
    assert visible.min() < 0.2
    assert faces.light.min() == SHADE < faces.light.max() == 1.0
    for clip in (cup, balls, faces):
        boxes = np.array([clip.boxes(step) for step in range(clip.steps)])
        assert np.all(boxes[:, :, :2] >= boxes[:, :, 2:])
        assert np.all(boxes[:, :, :2] + boxes[:, :, 2:] <= np.array(clip.size))


def test_a_target_is_found_by_an_estimate_of_its_own_within_its_radius() -> None:
    truth = np.array([BOX, [100.0, 60.0, 10.0, 14.0], [150.0, 60.0, 10.0, 14.0], [np.nan] * 4])
    counts = np.array([True, True, False, False])
    # one estimate between the first two is nobody's; one on the third is somebody's
    between = np.array([[75.0, 60.0, 10.0, 14.0], [150.0, 60.0, 10.0, 14.0]])
    found, astray = ppf.compare(truth, counts, between)
    assert_array_equal(found, [0.0, 0.0, np.nan, np.nan])
    assert astray == 0.5
    # two on one target find only one
    twice = np.array([BOX, [52.0, 60.0, 10.0, 14.0]])
    found, astray = ppf.compare(truth, counts, twice)
    assert_array_equal(found, [1.0, 0.0, np.nan, np.nan])
    assert astray == 0.0
    found, astray = ppf.compare(truth, counts, np.zeros((0, 4)))
    assert_array_equal(found, [0.0, 0.0, np.nan, np.nan])
    assert np.isnan(astray)
    found, astray = ppf.compare(truth, np.zeros(4, dtype=bool), twice)
    assert np.isnan(found).all()
    assert np.isnan(astray)


@pytest.mark.full
def test_of_two_alike_one_filter_follows_both_and_the_other_one(tmp_path: Path) -> None:
    clip = shortened(CLIPS["2BALL"](), 60)
    truth = np.array([clip.boxes(step) for step in range(60)])
    counts = np.zeros((60, 2), dtype=bool)
    counts[25:] = True
    scene = Scene(clip.name, clips.write(clip, tmp_path / "clip"), 0, 60, truth, counts)
    pseudo, classical = (
        ppf.summed_up(ppf.follow((scene, name, 2), NOBODY), scene) for name in (PSEUDO, CLASSICAL)
    )
    assert pseudo["frames"] == classical["frames"] == 35
    assert pseudo["every"] > 0.8
    assert pseudo["worst"] <= pseudo["every"] <= pseudo["each"]
    assert classical["every"] == 0.0
    assert classical["each"] <= 0.5

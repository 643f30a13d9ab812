"""People by their shape, in a room that nothing was learnt from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logit

from tracker import pipeline
from tracker.parameters import RunParameters, with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.rendering import render_random
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.trust import shapes_of_templates
from tracker.single_view.protocol import ViewResult

STEPS = 45


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """One person who walks, in a room that nothing was learnt from."""
    folder = tmp_path_factory.mktemp("rooms") / "39"
    render_random(39, folder, frames=STEPS)
    return read_sequence(folder)


def test_who_walks_is_found_by_shape_alone(room: Sequence) -> None:
    nobody_marked = replace(room, templates=(), digest=f"{room.digest}-unmarked")
    chosen = with_values(RunParameters(), {"single_view": "shapes"})
    run = pipeline.compute(nobody_marked, chosen)
    truth = Path(room.folder) / "ground_truth.csv"
    rows = np.genfromtxt(truth, delimiter=",", skip_header=1)
    near = 0
    for step in range(20, STEPS):
        there = run.tracks.positions[run.tracks.frames == step]
        place = rows[rows[:, 0] == step][0, 2:5]
        near += bool(len(there)) and np.linalg.norm(there - place, axis=1).min() < 0.5
    assert near > 0.8 * (STEPS - 20)


@pytest.mark.full
def test_what_is_little_in_one_camera_is_passed_on_and_weighed(room: Sequence) -> None:
    nobody_marked = replace(room, templates=(), digest=f"{room.digest}-passed")
    chosen = with_values(RunParameters(), {"single_view": "shapes"})
    views = pipeline.compute(nobody_marked, chosen, steps=25).views
    boxes = [view for step in views for view in step]
    odds = logit(np.concatenate([view.weights for view in boxes]))
    ratios = np.concatenate([view.log_ratios for view in boxes])
    p = chosen.shapes
    assert p.passed_odds <= odds.min() < p.least_odds < odds.max()
    np.testing.assert_allclose(
        ratios, np.minimum(p.odds_weight * (odds - p.even_odds), p.largest_ratio), atol=1e-6
    )
    assert ratios[odds < p.even_odds].max() < 0.0


def test_shape_is_believed_of_whose_template_shows_one(room: Sequence) -> None:
    (template,) = {t.name: t for t in room.templates}.values()
    left, top, width, height = template.box
    camera = next(c for c in room.cameras if c.name == template.camera)
    # the same box where nobody is: on the other side of the picture
    across = left - 3.0 * width if left > camera.image_size[0] / 2.0 else left + 3.0 * width
    nobody = replace(template, name="wall", box=np.array([across, top, width, height]))
    unseen = replace(template, name="elsewhere", camera="none")
    taught = replace(room, templates=(template, nobody, unseen))
    with FrameReader(taught) as reader:
        found = shapes_of_templates(taught, reader)
    trust = found.trust
    assert trust[template.name] > 0.5
    assert trust["wall"] < 0.2
    assert trust["elsewhere"] == 0.0
    # of the three the one shares most of its box with the person by shape, the others nothing
    assert 0.3 / 3.0 < found.fit < 0.45


@pytest.mark.full
def test_where_shapes_fit_the_templates_they_place_whom_colours_find(room: Sequence) -> None:
    def seen(shapes: str) -> list[ViewResult]:
        chosen = with_values(RunParameters(), {"single_view": "colour_phd"})
        chosen = with_values(chosen, {"colour_phd.shapes": shapes})
        run = pipeline.compute(room, chosen, steps=20)
        return [view for step in run.views for view in step]

    alone, both = seen("never"), seen("fitting")
    assert not any(len(view.log_ratios) for view in alone)
    assert all(len(view.log_ratios) == len(view.boxes) for view in both)
    best = [view for view in both if view.log_ratios.max(initial=-np.inf) > 0.0]
    assert len(best) > len(both) / 4
    for view in best:
        surest = int(view.log_ratios.argmax())
        assert view.sigmas[surest, 0] < view.boxes[surest, 2], "placed by shape, not by colour"

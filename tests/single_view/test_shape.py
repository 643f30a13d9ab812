"""People by their shape, in a room that nothing was learnt from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.rooms import render_random
from tracker import pipeline
from tracker.parameters import RunParameters, with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.trust import shapes_of_templates

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

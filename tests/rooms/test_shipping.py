"""The built-in sequences are what the generator gives, and nothing else is in their folders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.rooms import ROOMS, render
from tests.rooms.folder import describe_room, write_truth
from tests.rooms.rooms import CAMERAS, TARGET_HALF_EXTENTS
from tests.rooms.shipping import STEPS, TRUTH, shipped_text
from tests.rooms.studio import Studio, studio_of
from tracker.sequences import built_in
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE, read_sequence

pytestmark = pytest.mark.full  # the generator is no part of the program

MOST_DIFFERENT = 4.0
"""Mean difference in grey levels that compression may leave."""


@pytest.mark.parametrize("name", built_in.BUILT_IN)
def test_a_built_in_sequence_is_what_the_generator_gives(name: str, tmp_path: Path) -> None:
    folder = built_in.ROOMS / name
    assert {path.name for path in folder.iterdir()} == {FILE, TRUTH, "cam1.mp4", "cam2.mp4"}
    sequence = read_sequence(folder)
    studio = studio_of(ROOMS[name], CAMERAS[:2], seed=0)
    write_truth(tmp_path / TRUTH, studio.scene, STEPS)
    assert (folder / TRUTH).read_bytes() == (tmp_path / TRUTH).read_bytes()
    templates = []
    for template in sequence.templates:
        person = int(template.name.removeprefix("person")) - 1
        camera = [one.name for one in studio.cameras].index(template.camera)
        centre = studio.scene.figures[person].centres[[template.frame]]
        box = studio.cameras[camera].project_boxes(centre, TARGET_HALF_EXTENTS)[0][0]
        templates.append((person, camera, template.frame, box))
    text = describe_room(ROOMS[name], studio.cameras, STEPS, studio.scene, templates)
    assert (folder / FILE).read_text(encoding="utf-8") == shipped_text(text)
    first = sequence.templates[0]
    with FrameReader(sequence) as reader:
        for step in (0, first.frame, STEPS - 1):
            assert difference(studio, reader, step) < MOST_DIFFERENT
    assert studio.draw(first.frame, first.frame + 1).visible[0].max() > 0.985


def difference(studio: Studio, reader: FrameReader, step: int) -> float:
    """The largest mean difference, over the cameras, between drawn and shipped pictures."""
    drawn = studio.draw(step, step + 1).pictures
    shipped = [reader.picture(camera, step) for camera in range(len(drawn))]
    assert all(picture is not None for picture in shipped)
    pairs = zip(drawn, shipped, strict=True)
    return max(float(np.abs(one[0].astype(float) - other).mean()) for one, other in pairs)


def test_templates_are_chosen_as_the_generator_chooses_them(tmp_path: Path) -> None:
    render("room24-2p", tmp_path / "room24-2p", frames=STEPS)
    text = (tmp_path / "room24-2p" / FILE).read_text(encoding="utf-8")
    shipped = (built_in.ROOMS / "room24-2p" / FILE).read_text(encoding="utf-8")
    assert shipped == shipped_text(text)

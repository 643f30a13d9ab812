"""Two heads before a small camera, and few positions: the kernels may be interpreted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tests import world
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view import box_sizes

STEPS = 8
COLOURS = (((40.0, 40.0, 90.0), (50.0, 60.0, 210.0)), ((40.0, 90.0, 40.0), (60.0, 200.0, 70.0)))
"""Red and green, the upper half darker."""


@pytest.fixture(scope="module", autouse=True)  # in other folders it holds no more
def _few_positions() -> Iterator[None]:
    """Sixty thousand positions are projected in no time by a compiled kernel alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(box_sizes, "POSITIONS", 4000)
        yield


@pytest.fixture(scope="session")
def heads(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """A red and a green head that walk towards each other, and a template of each."""
    camera = world.look_at(
        "cam1", (0.3, -2.6, 1.5), (0.0, 0.0, 1.1), focal=90.0, image_size=(96, 72)
    )
    # neither is anywhere in more than half of the pictures, from which the background is learnt
    paths = world.together(
        world.walk([(-0.9, 0.1, 1.2), (-0.1, 0.3, 1.2)], [0, 1], STEPS),
        world.walk([(0.9, 0.2, 1.1), (0.2, 0.5, 1.1)], [0, 1], STEPS),
    )
    room = world.volume(1.2, 1.9, [(-1.1, 0.0, 1.2), (1.1, 0.2, 1.1)], (0.2, 0.3, 0.1))
    boxes = world.upright(camera, paths[4], world.HEAD)
    templates = [
        Template(name, "cam1", 4, np.concatenate([box[:2] - box[2:], 2.0 * box[2:]]))
        for name, box in zip(("red", "green"), boxes, strict=True)
    ]
    whole = world.sequence(
        (camera,), paths, fps=STEPS, room=room, half_extents=world.HEAD, templates=templates
    )
    picture = world.painted((camera,), paths, COLOURS, half_extents=world.HEAD)
    return read_sequence(world.folder(tmp_path_factory.mktemp("heads") / "heads", whole, picture))


@pytest.fixture(scope="session")
def reader(heads: Sequence) -> Iterator[FrameReader]:
    """Of the heads' pictures."""
    with FrameReader(heads) as opened:
        yield opened

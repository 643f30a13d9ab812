"""A picture of the empty scene, or the steps at which nobody is there."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import pytest

from tests.single_view.scenery import empty_room, person_mask, photograph, with_person
from tests.synthetic import camera_toml, head_toml, write_sequence
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.by_step import write_by_step
from tracker.single_view.pictures.background import BackgroundModel
from tracker.single_view.pictures.foreground import learn, learn_background
from tracker.single_view.rectification.sequence import RectifiedSequence

_Made = TypeVar("_Made")

STEPS = 12
SITS_AT = 60
EMPTY_STEPS = "background = [0, 2]"
EMPTY_FILE = 'background = "empty.png"'


def sitting(folder: Path, lines: tuple[str, ...]) -> Sequence:
    """Somebody who sits in one place in all pictures but the first three."""
    room = empty_room()
    (folder / "cam1").mkdir(parents=True)
    for step in range(STEPS):
        seen = room if step < 3 else with_person(room, SITS_AT)
        picture = photograph(seen, 1.0 + 0.02 * step, seed=step)
        cv2.imwrite(str(folder / "cam1" / f"{step:03d}.png"), picture)
    cv2.imwrite(str(folder / "empty.png"), photograph(room, 0.8, seed=99))
    camera = camera_toml("cam1", (128, 96), ['images = "cam1/*.png"', *lines])
    (folder / "sequence.toml").write_text(head_toml(STEPS) + camera, encoding="utf-8")
    return read_sequence(folder)


def share_seen(sequence: Sequence, parameters: ForegroundParams) -> float:
    """How much of who sits is foreground in the last picture."""
    with FrameReader(sequence) as reader:
        model = learn(sequence, 0, reader, parameters)
        picture = reader.picture(0, STEPS - 1)
        assert model is not None
        assert picture is not None
        _, found = model.step(model.start(), picture)
    return float(found.mask[person_mask(SITS_AT)].mean())


@pytest.mark.parametrize("model", ["learnt", "adaptive"])
@pytest.mark.parametrize("line", [EMPTY_FILE, EMPTY_STEPS])
def test_who_never_moves_is_seen_before_a_scene_that_is_known(
    tmp_path: Path, line: str, model: str
) -> None:
    parameters = ForegroundParams.model_validate({"model": model})
    unknown = sitting(tmp_path / "unknown", ())
    assert share_seen(unknown, parameters) < 0.1
    # the c-means takes what differs most
    least = {"learnt": 0.6, "adaptive": 0.35}[model]
    assert share_seen(sitting(tmp_path / "known", (line,)), parameters) > least


def test_a_known_background_is_not_doubted(tmp_path: Path) -> None:
    sequence = sitting(tmp_path / "known", (EMPTY_FILE,))
    assert isinstance(sequence.views[0].background, Path)
    with FrameReader(sequence) as reader:
        background = learn_background(sequence, 0, reader)
        learnt = learn_background(
            replace(sequence, views=(replace(sequence.views[0], background=None),)),
            0,
            _Forgetful(reader),
        )
    assert isinstance(background, BackgroundModel)
    assert background.changing_share == 0.0
    assert learnt is not None
    np.testing.assert_array_equal(background.spread, learnt.spread)


class _Forgetful:
    """A reader's pictures, and nothing that was made of them before."""

    def __init__(self, reader: FrameReader) -> None:
        self.picture, self.iterate, self.check = reader.picture, reader.iterate, reader.check

    def empty(self, camera: int) -> None:
        return None

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        return make()


def test_the_picture_is_reduced_as_the_others_are(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "large", frames=3, size=(960, 720), container="images")
    (folder / "empty.jpg").write_bytes((folder / "cam1" / "00001.jpg").read_bytes())
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    text = text.replace('images = "cam1', 'background = "empty.jpg"\nimages = "cam1')
    (folder / "sequence.toml").write_text(text, encoding="utf-8")
    sequence = read_sequence(folder)
    parameters = RunParameters(single_view="colour_phd")
    with FrameReader(sequence) as reader:
        rectified = RectifiedSequence.of(sequence, parameters, reader)
        empty, picture = rectified.reader.empty(0), rectified.reader.picture(0, 1)
        assert rectified.reader.empty(1) is None
    assert empty is not None
    assert empty.shape[0] < 720
    np.testing.assert_array_equal(empty, picture)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('background = "none.png"', 'there is no file "none.png" in the sequence folder'),
        ('background = "sequence.toml"', '"sequence.toml" cannot be read as a picture ('),
        ('background = "small.png"', "background 4×4 does not match calibration 128×96"),
        ("background = [3]", "expected 2 numbers"),
        (
            "background = 3",
            "last step without anybody such as [0, 24], found 3",
        ),
    ],
)
def test_what_shows_no_empty_scene_is_told(tmp_path: Path, line: str, told: str) -> None:
    (tmp_path / "room").mkdir()
    cv2.imwrite(str(tmp_path / "room" / "small.png"), np.zeros((4, 4, 3), dtype=np.uint8))
    with pytest.raises(SequenceError) as error:
        sitting(tmp_path / "room", (line,))
    assert told in str(error.value)


def test_a_camera_without_pictures_has_no_background(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "boxes", container=None, detections=True)
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    text = text.replace('detections = "cam1', 'background = [0, 1]\ndetections = "cam1')
    (folder / "sequence.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SequenceError, match="expected a camera with a video or images"):
        read_sequence(folder)


@pytest.mark.parametrize("line", [EMPTY_FILE, EMPTY_STEPS])
def test_a_copy_with_videos_knows_it_too(tmp_path: Path, line: str) -> None:
    sequence = sitting(tmp_path / "known", (line,))
    write_by_step(tmp_path / "copy", sequence, videos=True)
    copy = read_sequence(tmp_path / "copy")
    assert share_seen(copy, ForegroundParams()) > 0.6

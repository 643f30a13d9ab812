"""A camera of another recording is named by the import and by the check in the same words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.io.folders import make_folder
from tests.random_rooms import random_room
from tracker.io.checks import check
from tracker.io.importing.gathering import gather
from tracker.io.importing.preview import as_sequence
from tracker.io.importing.settling import settle
from tracker.io.importing.writing import write
from tracker.sequences.reader import read_sequence

SAME = "every camera agrees with another"
SEED = 77


@pytest.mark.parametrize(
    ("number", "words", "status"),
    [
        (8, "cam3: boxes agree with those of no other camera", "warning"),
        (9, "cam4: nothing confirms that these show the same moments", "absent"),
    ],
)
def test_a_camera_of_another_recording_is_named_by_both(
    number: int, words: str, status: str, tmp_path: Path
) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    rng = np.random.default_rng([SEED, number])
    known = make_folder(folder, rng, "boxes of another recording")
    plan = settle(gather([folder]), known.options)
    (told,) = (sentence for sentence in plan.told if sentence.startswith(words))
    write(plan, tmp_path / "written", "strangers")
    for sequence in (as_sequence(plan, "strangers"), read_sequence(tmp_path / "written")):
        found = [one for one in check(sequence, pictures=False) if one.name == SAME]
        assert [(one.status, one.sentence) for one in found] == [(status, told)]


@pytest.mark.parametrize("seed", range(3))
def test_right_cameras_are_confirmed(seed: int) -> None:
    sequence = random_room(seed, cameras=4, people=3)
    (found,) = (one for one in check(sequence, pictures=False) if one.name == SAME)
    assert found.status == "good"

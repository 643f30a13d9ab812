"""A camera of another recording is named by the import and by the check in the same words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.io.folders import make_folder
from tests.io.read.recorded import detections, settled_of, toml
from tests.random_rooms import random_room
from tracker.io.checks import check
from tracker.io.conventions.search import find_reading
from tracker.io.importing.gathering import gather
from tracker.io.importing.settling import settle
from tracker.io.importing.writing import as_sequence, write
from tracker.sequences.reader import read_sequence

SAME = "every camera agrees with another"
MOMENTS = "cameras show the same moments"
SEED = 77


@pytest.mark.parametrize(
    ("number", "words", "name", "status"),
    [
        (8, "cam3: boxes agree with those of no other camera", SAME, "warning"),
        (9, "cam4: nothing confirms that it shows the moments of the others", MOMENTS, "absent"),
    ],
)
def test_a_camera_of_another_recording_is_named_by_both(
    number: int, words: str, name: str, status: str, tmp_path: Path
) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    rng = np.random.default_rng([SEED, number])
    known = make_folder(folder, rng, "boxes of another recording")
    plan = settle(gather([folder]), known.options)
    (told,) = (sentence for sentence in plan.told if sentence.startswith(words))
    write(plan, tmp_path / "written", "strangers")
    for sequence in (as_sequence(plan, "strangers"), read_sequence(tmp_path / "written")):
        found = {one.name: one for one in check(sequence, pictures=False)}
        assert found[name].status == status
        assert told in found[name].sentence
        # what holds of the others is said of them alone
        moments = found[MOMENTS].sentence
        known = [camera.name for camera in sequence.cameras if camera.name not in words]
        assert moments.startswith(f"{', '.join(known[:-1])} and {known[-1]}: ")
        if name == SAME:
            assert f"boxes of {', '.join(known[:-1])}" in found["people are in the room"].sentence
            seconds = re.search(r"late by more than ([\d.]+) s", told)
            assert seconds is not None
            assert float(seconds[1]) <= sequence.frames / sequence.fps / 3.0


@pytest.mark.parametrize("sure", [True, False])
def test_an_import_and_the_check_of_what_it_wrote_compare_the_same_boxes(
    sure: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of low scores are left out by both, unless a file has no others."""
    toml(tmp_path)
    detections(tmp_path)
    for path in tmp_path.glob("cam*.csv"):
        head, *rows = path.read_text().splitlines()
        scored = [f"{row},{0.9 if sure and n % 2 else 0.1}" for n, row in enumerate(rows)]
        path.write_text("\n".join([f"{head},score", *scored]) + "\n")
    taken: list[list[int]] = []

    def count(cameras: Any, seen: Sequence[Any], **others: Any) -> Any:
        taken.append([0 if own is None else len(own.frames) for own in seen])
        return find_reading(cameras, seen, **others)

    monkeypatch.setattr("tracker.io.importing.settling.find_reading", count)
    monkeypatch.setattr("tracker.io.checks.boxes.find_reading", count)
    plan = settled_of(tmp_path)
    check(as_sequence(plan, "scored"), pictures=False)
    by_import, by_check = taken[0], taken[-1]
    assert len(taken) >= 2
    assert by_import == by_check
    rows = [len(path.read_text().splitlines()) - 1 for path in sorted(tmp_path.glob("cam*.csv"))]
    assert by_import == [count // 2 if sure else count for count in rows]


@pytest.mark.parametrize("seed", range(3))
def test_right_cameras_are_confirmed(seed: int) -> None:
    sequence = random_room(seed, cameras=4, people=3)
    (found,) = (one for one in check(sequence, pictures=False) if one.name == SAME)
    assert found.status == "good"

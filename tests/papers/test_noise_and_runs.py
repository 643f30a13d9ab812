"""Noise that is the same for the same seed; the same boxes seen by fewer cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.folders import write_crossing
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Unavailable
from tests.papers.laboratory.noise import NoisyReader
from tests.synthetic import write_sequence
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    folder = tmp_path_factory.mktemp("data") / "numbers"
    write_sequence(folder, frames=12, container="mp4")
    return read_sequence(folder)


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    return read_sequence(write_crossing(tmp_path_factory.mktemp("data") / "crossing"))


def test_noise_has_the_stated_size_and_no_mean(pictures: Sequence) -> None:
    with FrameReader(pictures) as clean, NoisyReader(pictures, sigma=5.0, seed=1) as noisy:
        plain, added = clean.picture(0, 3), noisy.picture(0, 3)
    assert plain is not None
    assert added is not None
    middle = (plain > 40) & (plain < 215)
    difference = added.astype(float)[middle] - plain[middle]
    assert abs(difference.mean()) < 0.2
    assert difference.std() == pytest.approx(5.0, rel=0.05)
    assert added.dtype == np.uint8


def test_noise_is_that_of_seed_camera_and_step(pictures: Sequence) -> None:
    with (
        NoisyReader(pictures, sigma=5.0, seed=1) as one,
        NoisyReader(pictures, sigma=5.0, seed=1) as same,
        NoisyReader(pictures, sigma=5.0, seed=2) as other,
        FrameReader(pictures) as clean,
    ):
        walked = list(one.iterate(1, 4))
        assert len(walked) == 8
        for step, picture in enumerate(walked, 4):
            np.testing.assert_array_equal(picture, same.picture(1, step))

        def noise(reader: FrameReader, camera: int, step: int) -> np.ndarray:
            added, plain = reader.picture(camera, step), clean.picture(camera, step)
            assert added is not None
            assert plain is not None
            return added.astype(int) - plain

        pieces = [noise(one, 0, 4), noise(one, 1, 4), noise(one, 0, 5), noise(other, 0, 4)]
    for i, first in enumerate(pieces):
        for second in pieces[:i]:
            assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.05


def test_no_picture_stays_no_picture(pictures: Sequence) -> None:
    with NoisyReader(pictures, sigma=5.0, seed=1) as reader:
        assert reader.picture(0, 99) is None


def test_fusing_again_with_all_cameras_gives_the_same_tracks(crossing: Sequence) -> None:
    run = pipeline.compute(crossing, pipeline.default_parameters(crossing))
    again = runs.fused_again(run, range(len(crossing.views)))
    np.testing.assert_array_equal(again.positions, run.filtered.positions)
    np.testing.assert_array_equal(again.ids, run.filtered.ids)


@pytest.mark.full
@pytest.mark.parametrize("cameras", [[0], [1], [2, 0]])
def test_fusing_again_is_a_run_of_the_sequence_with_these_cameras(
    crossing: Sequence, cameras: list[int]
) -> None:
    parameters = pipeline.default_parameters(crossing)
    run = pipeline.compute(crossing, parameters)
    fewer = runs.with_cameras(crossing, cameras)
    assert [c.name for c in fewer.cameras] == [crossing.cameras[c].name for c in cameras]
    assert fewer.digest != crossing.digest
    expected = pipeline.compute(fewer, parameters)
    found = runs.fused_again(run, cameras)
    np.testing.assert_array_equal(found.positions, expected.filtered.positions)
    np.testing.assert_array_equal(found.frames, expected.filtered.frames)
    assert found.seen.shape[1] == len(cameras)
    other = with_values(parameters, {"fusion.extraction_threshold": 0.9})
    assert len(runs.fused_again(run, cameras, other)) <= len(found)


def test_a_run_is_computed_once(crossing: Sequence) -> None:
    told: list[str] = []
    context = Context(told=lambda words, done, total: told.append(words))
    first = runs.computed(context, crossing)
    assert first.steps_per_second > 0.0
    assert set(told) == {"tracking in crossing"}
    assert runs.computed(context, crossing) is first
    assert runs.computed(context, crossing, steps=20).run.done == 20
    assert runs.computed(Context(), crossing) is not first


def test_a_recording_that_is_not_at_hand(tmp_path: Path) -> None:
    with pytest.raises(Unavailable, match="--data DIR"):
        runs.recording(Context(), "cmc9")
    with pytest.raises(Unavailable, match="cmc9 is not at hand"):
        runs.recording(Context(data=tmp_path), "cmc9")
    write_crossing(tmp_path / "cmc9", 10)
    assert runs.recording(Context(data=tmp_path), "cmc9").frames == 10


@pytest.mark.full
def test_a_shortened_room_is_rendered_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(tmp_path))
    told: list[str] = []
    context = Context(told=lambda words, done, total: told.append(words))
    room = runs.room(context, "room24-2p", 3)
    assert room.frames == 3
    assert set(told) == {"rendering room24-2p"}
    told.clear()
    assert runs.room(context, "room24-2p", 3).digest == room.digest
    assert told == []
    (room.folder / "ground_truth.csv").unlink()
    assert runs.room(context, "room24-2p", 3).frames == 3
    assert told

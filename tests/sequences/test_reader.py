"""The folder reader: what it reads, and the sentence for everything that can be wrong."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.synthetic import camera_toml, head_toml, write_sequence, write_video
from tracker.io.checks import check
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import read_sequence, read_summary


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good sequence with everything in it; tests change copies."""
    return write_sequence(tmp_path_factory.mktemp("good") / "room", frames=8, detections=True)


@pytest.fixture
def folder(source: Path, tmp_path: Path) -> Path:
    """A copy to be spoilt."""
    copy = tmp_path / "room"
    copy.mkdir()
    for path in source.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    return copy


def edit(folder: Path, old: str, new: str, file: str = "sequence.toml") -> None:
    """Replace the first occurrence of some text, which must be there."""
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")


def complaint(folder: Path) -> str:
    """The one sentence with which the folder is refused."""
    with pytest.raises(SequenceError) as caught:
        read_sequence(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert not message.endswith(".")
    return message


def test_everything_in_the_file_is_read(source: Path) -> None:
    sequence = read_sequence(source)
    assert (sequence.name, sequence.fps, sequence.frames) == ("numbers", 25.0, 8)
    assert sequence.description == "frames that carry their number"
    assert sequence.folder == source.resolve()
    assert sequence.room.minimum.tolist() == [-1.5, -1.5, 0.0]
    assert sequence.room.maximum.tolist() == [1.5, 1.5, 2.0]
    (entrance,) = sequence.room.entrances
    assert entrance.position.tolist() == [1.4, 0.0, 1.0]
    assert entrance.sigma.tolist() == [0.3, 0.3, 0.15]
    assert sequence.target_half_extents.tolist() == [0.3, 0.3, 0.84]
    assert [camera.name for camera in sequence.cameras] == ["cam1", "cam2"]
    assert [view.video for view in sequence.views] == [
        source.resolve() / "cam1.mp4",
        source.resolve() / "cam2.mp4",
    ]
    assert sequence.has_pictures
    assert sequence.has_detections
    detections = sequence.views[1].detections
    assert detections is not None
    assert detections.frames.tolist() == list(range(8))
    assert detections.boxes[3].tolist() == [23.5, 30.25, 24.0, 48.0]
    assert detections.scores.tolist() == [0.9] * 8
    (template,) = sequence.templates
    assert (template.name, template.camera, template.frame) == ("person1", "cam1", 4)
    truth = sequence.ground_truth
    assert truth is not None
    assert truth.positions[4].tolist() == [0.0, 0.2, 0.84]
    assert truth.valid.tolist() == [False, True, True, True, True, False, True, True]
    assert sequence.warnings == ()


@pytest.mark.parametrize("missing", ["room", "target"])
def test_a_room_or_a_target_alone_that_is_not_stated_is_found(folder: Path, missing: str) -> None:
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    begin = text.index(f"[{missing}]")
    edit(folder, text[begin : text.index("\n\n", begin)], "")
    sequence = read_sequence(folder)
    assert [said.partition(" is")[0] for said in sequence.warnings][:1] == [f"[{missing}]"]
    stated = (sequence.room.maximum.tolist() == [1.5, 1.5, 2.0],
              sequence.target_half_extents.tolist() == [0.3, 0.3, 0.84])  # fmt: skip
    assert stated == (missing == "target", missing == "room")


def test_the_sequence_file_itself_may_be_named(source: Path) -> None:
    assert read_sequence(source / "sequence.toml").folder == source.resolve()
    assert read_sequence(str(source)).folder == source.resolve()


def test_summary_needs_no_videos(folder: Path) -> None:
    (folder / "cam1.mp4").unlink()
    summary = read_summary(folder)
    assert (summary.name, summary.frames, summary.cameras) == ("numbers", 8, 2)


def test_the_digest_follows_every_file(folder: Path) -> None:
    digests = [read_sequence(folder).digest]
    for name in ("cam1.mp4", "cam2.csv", "ground_truth.csv"):
        os.utime(folder / name, ns=(0, 123_456_789))
        digests.append(read_sequence(folder).digest)
    edit(folder, "fps = 25.0", "fps = 24.0")
    digests.append(read_sequence(folder).digest)
    assert len(set(digests)) == 5
    assert read_sequence(folder).digest == digests[-1]


def test_missing_folder_and_missing_file(tmp_path: Path, folder: Path) -> None:
    gone = tmp_path / "rooom"
    assert complaint(gone) == f'{gone}: there is no such folder; did you mean "room"?'
    video = folder / "cam1.mp4"
    assert complaint(video) == (
        f"{video}: expected a folder with a sequence.toml in it, found a file; make one of other "
        f"files by `multiview-phd import {video} -o NEW_FOLDER`"
    )
    empty = tmp_path / "an empty one"
    empty.mkdir()
    assert complaint(empty) == (
        f"{empty}: there is no sequence.toml in this folder; "
        f"make one of other files by `multiview-phd import '{empty}' -o NEW_FOLDER`"
    )
    (folder / "sequence.toml").rename(folder / "sequence.tml")
    assert complaint(folder).endswith('this folder; did you mean "sequence.tml"?')


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="needs a user who can be refused")
def test_an_unreadable_folder_is_said(folder: Path) -> None:
    folder.chmod(0)
    try:
        assert complaint(folder) == (
            f"{folder}: cannot be read (Permission denied); check its permissions"
        )
    finally:
        folder.chmod(0o700)


def test_no_camera_and_no_table(folder: Path, tmp_path: Path) -> None:
    (folder / "sequence.toml").write_text(head_toml(8), encoding="utf-8")
    assert complaint(folder) == (
        "room/sequence.toml, camera: expected at least one table [[camera]], found none"
    )
    text = head_toml(8).replace("[room]", "camera = 3\n[room]")
    (folder / "sequence.toml").write_text(text, encoding="utf-8")
    assert complaint(folder) == (
        "room/sequence.toml, camera: expected tables that begin with the line [[camera]], found 3"
    )


def link(target: Path) -> Callable[[Path], None]:
    """A symbolic link to ``target``, or skip where there are none."""

    def make(path: Path) -> None:
        try:
            path.symlink_to(target)
        except OSError:
            pytest.skip("symbolic links cannot be made here")

    return make


def test_a_link_within_the_folder_is_fine(folder: Path) -> None:
    (folder / "cam1.mp4").rename(folder / "other.mp4")
    link(folder / "other.mp4")(folder / "cam1.mp4")
    assert read_sequence(folder).views[0].has_pictures


def test_a_short_video_opens_with_a_warning(folder: Path) -> None:
    write_video(folder / "cam1.mp4", range(6), "mp4v")
    edit(folder, 'video = "cam2.mp4"', 'video = "cam2.mp4"\nfirst_frame = 1')
    assert read_sequence(folder).warnings == (
        'camera "cam1": the video has too few: expected 8 frames, found 6; '
        "steps 6 to 7 have no picture",
        'camera "cam2": the video has too few: expected 8 frames from frame 1 on, found 7; '
        "step 7 has no picture",
    )


def test_a_camera_that_looks_away_is_warned_of(folder: Path) -> None:
    edit(folder, "t = [0.0, 1.0, 4.0]", "t = [0.0, 1.0, -4.0]")
    (warning,) = read_sequence(folder).warnings
    assert warning.startswith("cam1 sees nothing of the room: check that R and t")
    assert warning in [str(one) for one in check(read_sequence(folder), quick=True)]


def test_a_camera_table_alone_is_enough(tmp_path: Path) -> None:
    text = head_toml(5) + camera_toml("cam1")
    (tmp_path / "sequence.toml").write_text(text, encoding="utf-8")
    sequence = read_sequence(tmp_path)
    assert not sequence.has_pictures
    assert not sequence.has_detections
    assert sequence.templates == ()
    assert sequence.ground_truth is None


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "cameras", "frames", "pictures", "certain"),
    [
        ("av163-seq30-2p-1101", 3, 500, True, 648),
        ("av163-seq45-3p-1111-points", 3, 1053, False, 2176),
        ("cmc1", 4, 261, False, 656),
        ("cmc2", 4, 261, False, 2076),
    ],
)
def test_real_recordings_open_without_a_warning(
    data_folder: Path, name: str, cameras: int, frames: int, pictures: bool, certain: int
) -> None:
    sequence = read_sequence(data_folder / name)
    assert (sequence.name, len(sequence.views), sequence.frames) == (name, cameras, frames)
    assert sequence.has_pictures is pictures
    assert sequence.has_detections is not pictures
    assert sequence.ground_truth is not None
    assert sequence.ground_truth.valid.sum() == certain
    assert sequence.warnings == ()

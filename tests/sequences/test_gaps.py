"""A picture that is missing is told: on opening, by the run, in the file, by the exit status."""

from __future__ import annotations

import copy
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.command import main as cli
from tests.synthetic import CODECS, number_in, write_sequence, write_video
from tracker.export import tracks_csv
from tracker.parameters.values import with_values
from tracker.runs import gaps, pipeline
from tracker.runs.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.runs.stage_files import StageFiles
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.pictures.numbering import by_number, whole_row
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import taught_values, with_taught

STEPS = 30
BY_PICTURES = {"single_view": "association_matrix"}


def tracked(sequence: Sequence, cache: StageCache | None = None) -> Run:
    wanted = with_values(pipeline.default_parameters(sequence), BY_PICTURES)
    return pipeline.compute(sequence, wanted, cache=cache)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_sequence(tmp_path / "seq", frames=STEPS, container="mjpg.avi")


def spoil_gone(path: Path) -> None:
    path.rename(path.with_suffix(".away"))


def spoil_cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 3)


@pytest.mark.full
@pytest.mark.parametrize("spoil", [spoil_gone, spoil_cut])
def test_a_video_spoilt_after_opening_is_told_and_nothing_is_kept(
    folder: Path, tmp_path: Path, spoil: Callable[[Path], None]
) -> None:
    sequence = read_sequence(folder)
    video = folder / "cam2.avi"
    status, whole = video.stat(), video.read_bytes()
    spoil(video)
    files = tmp_path / "stages"
    cache = StageCache(files=StageFiles(files))
    run = tracked(sequence, cache)
    (gap,) = gaps.gaps(run)
    assert gap.camera == "cam2"
    assert gap.missing == len(gap.unexpected) >= STEPS // 3
    told = gaps.sentences(run)
    assert 'pictures of camera "cam2" are missing' in told[0]
    assert "cam2.avi changed or vanished" in told[1]
    assert gaps.where_to_keep(run) == "nowhere"
    assert not list(files.glob("*"))
    assert cache.used_bytes == 0
    # the file is whole again, as it was, under the time it had
    video.write_bytes(whole)
    os.utime(video, ns=(status.st_atime_ns, status.st_mtime_ns))
    again = tracked(sequence, cache)
    assert not gaps.sentences(again)
    assert list(files.glob("*"))


def test_another_description_on_disk_is_told_and_what_was_saved_here_is_not(
    folder: Path, tmp_path: Path
) -> None:
    opened = read_sequence(folder)
    run = tracked(opened)

    def narrowed(sequence: Sequence, width: float) -> Sequence:
        values = copy.deepcopy(taught_values(sequence))
        values["room"]["max"][0] = width
        return with_taught(sequence, values, "")

    narrow = narrowed(opened, 1.5)
    saving.save(narrow, opened)
    assert narrow.changed_files() == ()
    assert gaps.sentences(run) == [], "also of a run that began before"
    copied = saving.save_copy(narrow, narrow, tmp_path / "copy")
    with (folder / "sequence.toml").open("a", encoding="utf-8") as file:
        file.write("# by hand\n")
    assert copied.changed_files() == ()
    (told,) = gaps.sentences(run)
    assert told.startswith("sequence.toml changed or vanished since the recording was opened")
    assert gaps.where_to_keep(run) == "nowhere"
    saving.save(narrowed(opened, 1.25), narrow)  # what was written by hand is not taken up by it
    assert gaps.sentences(run) == [told]
    assert read_sequence(folder).changed_files() == ()


def test_a_video_that_comes_back_before_the_end_is_looked_at_again(folder: Path) -> None:
    sequence = read_sequence(folder)
    run = tracked(sequence)
    blind = replace(run.views[7][1], blind=True)
    # as it was while the file was away
    run.views = run.views.alike([*run.views[:7], (run.views[7][0], blind), *run.views[8:]])
    assert gaps.where_to_keep(run) == "nowhere"


def test_a_spoilt_picture_is_kept_for_this_start_only(folder: Path, tmp_path: Path) -> None:
    video = folder / "cam1.avi"
    data = bytearray(video.read_bytes())
    place = [k for k in range(len(data) - 4) if data[k : k + 4] == b"00dc"][12]
    data[place + 8 : place + 400] = bytes(392)
    video.write_bytes(data)
    sequence = read_sequence(folder)
    files = tmp_path / "stages"
    cache = StageCache(files=StageFiles(files))
    run = tracked(sequence, cache)
    (gap,) = gaps.gaps(run)
    assert len(gap.unexpected) == 1
    assert gaps.where_to_keep(run) == "in memory"
    assert cache.used_bytes > 0
    assert not list(files.glob("*"))


@pytest.mark.full
def test_a_short_video_is_told_on_opening_and_counted(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_video(folder / "cam2.avi", range(10), CODECS["mjpg.avi"], shade=1)
    sequence = read_sequence(folder)
    assert "steps 10 to 29 have no picture" in sequence.warnings[0]
    output = tmp_path / "tracks.csv"
    words = ["track", str(folder), "-o", str(output), "--single-view", "association_matrix"]
    words += ["--keep", "0", "--no-cache"]
    assert cli.main(words) == 0
    told = '20 of 30 pictures of camera "cam2" are missing'
    assert told in capsys.readouterr().err.strip().splitlines()[-1]
    assert f"# incomplete: {told}\n" in output.read_text(encoding="utf-8")
    assert tracks_csv.read_tracks_csv(output).remarks == (told,)
    assert cli.main([*words, "--strict"]) == 1
    assert output.is_file()


@pytest.mark.full
def test_whole_recordings_are_strictly_well(folder: Path, tmp_path: Path) -> None:
    words = ["track", str(folder), "-o", str(tmp_path / "t.csv"), "--strict", "--keep", "0"]
    assert cli.main([*words, "--single-view", "association_matrix", "--no-cache"]) == 0
    assert "incomplete" not in (tmp_path / "t.csv").read_text(encoding="utf-8")


@pytest.mark.full
def test_a_deleted_image_shifts_no_other(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "seq", frames=STEPS, container="images")
    (folder / "cam1" / "00009.jpg").unlink()
    sequence = read_sequence(folder)
    assert '"00009.jpg" is missing in the row' in sequence.warnings[0]
    with FrameReader(sequence) as reader:
        for step in (0, 8, 10, STEPS - 1):
            picture = reader.picture(0, step)
            assert picture is not None
            assert number_in(picture) == step
        assert reader.picture(0, 9) is None
    run = tracked(sequence)
    (gap,) = gaps.gaps(run)
    assert (gap.missing, gap.unexpected) == (1, ())


def test_a_copy_of_a_row_with_a_hole_has_the_hole(tmp_path: Path) -> None:
    from tracker.sequences.writing.saving import save_copy

    folder = write_sequence(tmp_path / "seq", frames=STEPS, container="images")
    (folder / "cam1" / "00009.jpg").unlink()
    sequence = read_sequence(folder)
    copy = save_copy(sequence, sequence, tmp_path / "copy")
    assert copy.warnings == sequence.warnings
    shutil.rmtree(folder)


@pytest.mark.parametrize(
    ("names", "row"),
    [
        (["a1.png", "a2.png", "a4.png"], ["a1.png", "a2.png", "a3.png", "a4.png"]),
        (["x_005_b", "x_010_b", "x_020_b"], ["x_005_b", "x_010_b", "x_015_b", "x_020_b"]),
        (["c2_1.png", "c2_2.png", "c2_4.png"], ["c2_1.png", "c2_2.png", "c2_3.png", "c2_4.png"]),
        (["1.png", "2.png", "900.png"], None),  # other numbers than a row's
        (["1.png", "17.png", "23.png", "41.png"], None),  # time stamps
        (["a.png", "b.png", "d.png"], None),
        (["a1b1", "a2b2", "a4b4"], None),  # two numbers
        (["a1.png", "a2.jpg", "a4.jpg"], None),
        (["9" * 40 + ".png", "9" * 41 + ".png", "9" * 42 + ".png"], None),
        (["1.png"], None),
        ([], None),
    ],
)
def test_which_names_are_a_row(names: list[str], row: list[str] | None) -> None:
    found, there = whole_row([Path(name) for name in names])
    assert [path.as_posix() for path in found] == (row or names)
    assert [path.as_posix() for path, has in zip(found, there, strict=True) if has] == names


def test_names_are_ordered_by_their_numbers_whatever_else_is_in_them() -> None:
    assert sorted(["cam10", "cam9", "cam¹", "²"], key=by_number) == ["cam9", "cam10", "cam¹", "²"]

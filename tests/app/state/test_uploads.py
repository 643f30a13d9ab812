"""What files that a page sends may be called, and how they arrive."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.state import importing
from app.state.importing import (
    Announced,
    Desk,
    ImportWish,
    Upload,
    UploadError,
    mended,
    safe_path,
)
from app.state.workbench import Workbench
from tracker.sequences.finding import Remedy


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("../cam1.mp4", "leads elsewhere"),
        ("a/../../b.csv", "leads elsewhere"),
        ("/etc/passwd", "leads elsewhere"),
        ("a//b.csv", "leads elsewhere"),
        ("", "leads elsewhere"),
        ("..\\b.csv", "without backslash and colon"),
        ("C:/b.csv", "without backslash and colon"),
        ("a\n.csv", "control characters"),
        ("x" * 201, "more than 200 bytes"),
        ("a/" * 10 + "b.csv", "within each other"),
        ("aux.csv", "not every file system"),
        ("folder./b.csv", "not every file system"),
    ],
)
def test_names_that_lead_elsewhere_are_refused(path: str, words: str) -> None:
    with pytest.raises(UploadError, match=words):
        safe_path(path)


def test_ordinary_names_are_taken() -> None:
    for path in ("cam1.mp4", "session 3/cam_01 (2).mp4", "Größe/ü.csv", "a.b.c"):
        assert safe_path(path).as_posix() == path


def _upload(folder: Path, **files: int) -> Upload:
    upload = Upload(folder)
    folder.mkdir()
    upload.announce([Announced(name, size) for name, size in files.items()])
    return upload


def test_pieces_come_one_after_the_other(tmp_path: Path) -> None:
    upload = _upload(tmp_path / "files", a=5, b=0)
    upload.receive(0, 0, b"abc")
    assert not upload.complete
    for offset, data, words in ((0, b"x", "from byte 3 on"), (3, b"xyz", "found more")):
        with pytest.raises(UploadError, match=words):
            upload.receive(0, offset, data)
    with pytest.raises(UploadError, match="was announced"):
        upload.receive(2, 0, b"x")
    upload.receive(0, 3, b"de")
    assert upload.complete
    assert (tmp_path / "files/a").read_bytes() == b"abcde"
    assert (tmp_path / "files/b").read_bytes() == b""


def test_what_has_no_room_is_refused_before_anything_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = _upload(tmp_path / "files", a=5)
    with pytest.raises(UploadError, match="at most 64 GB"):
        upload.announce([Announced("b", importing.MOST_BYTES)])
    with pytest.raises(UploadError, match="among the files already"):
        upload.announce([Announced("a", 1)])
    monkeypatch.setattr(importing, "SPARED_BYTES", 1 << 62)
    with pytest.raises(UploadError, match=r"has room for 0\.0 GB"):
        upload.announce([Announced("b", 1)])
    monkeypatch.setattr(importing, "MOST_FILES", 1)
    with pytest.raises(UploadError, match="at most 1 files"):
        upload.announce([Announced("b", 0)])
    assert upload.files == 1


def test_a_file_cannot_be_a_folder_too(tmp_path: Path) -> None:
    upload = _upload(tmp_path / "files", a=1)
    with pytest.raises((UploadError, OSError)):
        upload.announce([Announced("a/b", 1)])


def test_what_is_not_there_leaves_nothing(tmp_path: Path) -> None:
    desk = Desk(Workbench(), tmp_path)
    with pytest.raises(UploadError, match="there is no such file or folder"):
        desk.begin_from("nothing")
    assert list(tmp_path.iterdir()) == []


def test_the_oldest_import_makes_room(tmp_path: Path) -> None:
    desk = Desk(Workbench(), tmp_path)
    drafts = [desk.begin([Announced("a.csv", 1)]) for _ in range(6)]
    assert [desk.draft(draft.key) is not None for draft in drafts] == [False] * 2 + [True] * 4
    desk.close()
    assert list(tmp_path.iterdir()) == []


def test_calibrations_as_named_are_exchanged_no_longer() -> None:
    wish = ImportWish(swap=(("cam1", "cam2"),))
    assert mended(wish, [Remedy("--as-named", "")]) == {"as_named": True, "swap": ()}

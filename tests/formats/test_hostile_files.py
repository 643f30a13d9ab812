"""Files that mean harm or are spoilt get a sentence, in bounded memory and time."""

from __future__ import annotations

import json
import os
import struct
import time
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest

from tracker.formats.calibration import matlab
from tracker.formats.pieces import FormatError
from tracker.formats.source import SourceFile
from tracker.importing.gathering import gather

LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(12))
    + "]><opencv_storage><K>&m;</K></opencv_storage>"
)

HOSTILE: dict[str, bytes] = {
    "laughs.xml": LAUGHS.encode(),
    "outside.xml": b'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    b"<opencv_storage><K>&x;</K></opencv_storage>",
    "deep.json": b'{"people":' + b"[" * 200_000,
    "deep.xml": b"<opencv_storage>" + b"<a>" * 100_000,
    "deep.yml": b"%YAML:1.0\n---\nK: " + b"[" * 20_000,
    "laughs.yml": b"%YAML:1.0\n---\na: &a [1,1]\nK: [" + b"*a," * 1000 + b"*a]\n",
    "tag.yml": b"%YAML:1.0\n---\nK: !!python/object/apply:os.system [true]\n",
    "deep.toml": b"[cam_1]\nmatrix = " + b"[" * 50_000 + b"\ndistortions = []",
    "cut.json": b'[{"image_id": 3, "category_id": 1, "bbox": [1, 2,',
    "cut.xml": b"<?xml version='1.0'?><opencv_storage><camera_matrix type_id='opencv-matrix'><r",
    "cut.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }",
    "claims.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, "
    b"'shape': (999999999999, 3, 4), }" + b" " * 10 + b"\n",
    "pickled.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, "
    b"'shape': (3, 4), }" + b" " * 33 + b"\n" + b"cos\nsystem\n(S'true'\ntR.",
    "binary.csv": b"frame,left,top,width,height\n" + os.urandom(64).replace(b"\n", b"") + b"\0",
    "digits.json": b'[{"image_id": ' + b"9" * 10_000 + b', "bbox": [1,2,3,4], "score": 1}]',
    "infinite.csv": b"frame,left,top,width,height\n0,nan,inf,3,4\n1e400,1,2,3,4\n",
    "fractions.csv": b"frame,left,top,width,height\n0.5,1,2,3,4\n",
    "short.csv": b"frame,left,top,width,height\n0,1,2\n",
    "fake.mp4": b"\0\0\0\x18ftypisom" + b"\0" * 500,
    "fake.mat": b"MATLAB 5.0 MAT-file" + b" " * 200,
    "open.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, "
    b"'shape': (3, 4" + b" " * 58 + b"\n",
    "long.toml": b"[cam_1]\nmatrix = [[" + b"9" * 5000 + b"]]\n",
    "long.json": b'{"boxes": [{"frame": 1, "box": [1, 2, ' + b"9" * 400 + b", 4]}]}",
    "returns.csv": b'frame,time\n0,0.0\r\r0,"1\r1.0\n',
    "0.txt": b"0 0.5 0.5 0.1 0.2\n0 0.50.5 0.1 0.2 0.3\n0 0.5 0.5 0.1 0.2\n",
    "huge.json": b'{"sfm_data_version": "0.3", "views": [], "intrinsics": [], "extrinsics": '
    b'[{"key": 0, "value": {"rotation": [[1e308, 1e308, 0], [1e308, 1, 0], [0, 0, 1]], '
    b'"center": [0, 0, 1]}}]}',
    "names.json": b'{"cam1": {"K' + b"_" * 200_000 + b'": [1, 0, 0, 0, 1, 0, 0, 0, 1]}}',
    "names.txt": b"K" + b"_" * 200_000 + b" 1 0 0 0 1 0 0 0 1\n",
    "images.bin": struct.pack("<QI7dI", 2**31, 1, 1, 0, 0, 0, 0, 0, 0, 1) + b"a\0" + b"\xff" * 99,
    "utf-16.xml": (
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "' + "c" * 500 + '">]>'
        "<opencv_storage><K>&b;</K></opencv_storage>"
    ).encode("utf-16"),
    "half.csv": b"\xff\xfef\x00r\x00\x00\xd8",
    "huge.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[1e308, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [0, 0, 3]\n",
    "far.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [1e308, 0, 3]\n",
    "turned.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [1e300, 0, 0]\ntranslation = [0, 0, 3]\n",
    "flat.txt": b"1 2 3 4\n2 4 6 8\n1 1 1 1\n",
    "nowhere.txt": b"0 0 0 0\n0 0 0 0\n0 0 0 0\n",
    "named.json": b'{"' + b"c" * 5000 + b'": {"K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], '
    b'"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 3], "image_size": [640, 480]}}',
    "lines.csv": b"frame,left,top,width,height\n" + b"\n" * 10_000_001,
    "cut.npz": b"PK\x03\x04" + bytes(300),
    "session.zip": b"PK\x05\x06" + bytes(18),
    "empty.json": b"",
    "empty.xml": b"",
}


@pytest.mark.full
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_gives_nothing_but_a_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(HOSTILE[name])
    tracemalloc.start()
    begin = time.perf_counter()
    taken = gather([tmp_path])
    seconds = time.perf_counter() - begin
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 120.0
    assert peak < 200e6
    assert len(taken) == 1
    assert not [p for p in taken[0].pieces if getattr(p, "cameras", ()) or len(_boxes(p))]


def _boxes(piece: object) -> object:
    boxes = getattr(piece, "boxes", np.zeros(0))
    return boxes[np.isfinite(boxes).all(axis=1)] if len(boxes) else boxes


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("laughs.xml", "entities"),
        ("outside.xml", "entities"),
        ("laughs.yml", "references"),
        ("cut.json", "cut short"),
        ("cut.xml", "cut short"),
        ("deep.toml", "nesting"),
        ("short.csv", "columns"),
        ("fractions.csv", "whole number"),
        ("fake.mp4", "cannot be read as a video"),
        ("huge.toml", "cam_1 K: expected focal lengths from 0.1 to 1e+06 pixels"),
        ("far.toml", "cam_1 translation: expected numbers of at most 1e+12"),
        ("turned.toml", "cam_1.rotation: expected a rotation vector in radians, found [1e+300"),
        ("flat.txt", "flat.txt, projection: its left 3×3 part is singular"),
        ("nowhere.txt", "nowhere.txt, projection: its left 3×3 part is singular"),
        ("named.json", "camera 1: expected a name of at most 255 characters, found 5,000"),
        ("lines.csv", "has 10,000,002 lines, expected at most 10,000,000"),
        ("cut.npz", "a spoilt .npz"),
        ("session.zip", "is an archive"),
    ],
)
def test_the_sentence_says_what_is_wrong(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / name).write_bytes(HOSTILE[name])
    (one,) = gather([tmp_path])
    assert words in one.complaint
    assert name in one.complaint


def test_pictures_that_are_none_are_told(tmp_path: Path) -> None:
    for number in range(3):
        (tmp_path / f"{number:03}.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(60))
    (one,) = gather([tmp_path])
    assert "000.jpg: cannot be read as a picture (64 bytes); expected a whole JPEG" in one.complaint


@pytest.mark.full
def test_a_small_matlab_file_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    packed = zlib.compress(b"\0" * 100_000_000, 9)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path = tmp_path / "bomb.mat"
    path.write_bytes(head + (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little") + packed)
    with pytest.raises(FormatError, match="unpacks to more"):
        list(matlab.read(SourceFile(path)))


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.json"
    with path.open("wb") as stream:
        stream.write(b'{"people": [')
        stream.truncate(3 * 2**30)  # no room on the disk
    (one,) = gather([tmp_path])
    assert not one.pieces


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    secret = outside / "secret.json"
    secret.write_text(json.dumps([{"image_id": 1, "bbox": [1, 2, 3, 4], "score": 1}]))
    (inside / "link.json").symlink_to(secret)
    (inside / "folder").symlink_to(outside)
    (inside / "circle").symlink_to(inside / "circle")
    os.mkfifo(inside / "pipe.json")
    taken = gather([inside])
    assert len(taken) == 4
    assert all(not one.pieces and one.complaint for one in taken)


def test_what_is_not_there_is_said() -> None:
    with pytest.raises(FormatError, match="no such file"):
        gather([Path("/nowhere/at/all")])


def test_one_spoilt_file_of_several_cameras_costs_no_other(tmp_path: Path) -> None:
    for number in range(1, 5):
        rows = "".join(f"{frame},10,20,30,80\n" for frame in range(9))
        rows = "0,10,20\0\0" if number == 3 else rows
        (tmp_path / f"cam{number}.csv").write_text(f"frame,left,top,width,height\n{rows}")
    spoilt, whole = gather([tmp_path])
    assert spoilt.label == "cam3.csv"
    assert "cam3.csv: expected text" in spoilt.complaint
    assert whole.label == "cam1.csv … (3)"
    assert [piece.source.name for piece in whole.pieces] == ["cam1.csv", "cam2.csv", "cam4.csv"]

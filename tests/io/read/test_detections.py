"""Every format of boxes: what was written comes back, with its counting and its layout."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.io.read.rig import SIZE, boxes, boxes_in, boxes_of_one, cameras, read, walks
from tracker.io.conventions.reading import read_boxes
from tracker.io.importing.finding.times import on_one_clock
from tracker.io.read.columns import people
from tracker.io.read.pieces import DetectionPiece, FormatError, TruthPiece
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile

CAMERA = cameras()[0]
FRAMES, BOXES = boxes(CAMERA, walks())


def _assert_boxes(piece: DetectionPiece, tolerance: float = 1e-9, first: int = 0) -> None:
    size = SIZE if piece.normalised else None
    found = read_boxes(piece.boxes, piece.layout or "ltwh", size)
    np.testing.assert_array_equal(piece.frames - first, FRAMES)
    np.testing.assert_allclose(found, BOXES, atol=tolerance)


def _corners(box: ndarray) -> list[float]:
    left, top, width, height = box.tolist()
    return [left, top, left + width, top + height]


def test_motchallenge_counts_from_1(tmp_path: Path) -> None:
    path = tmp_path / "det.txt"
    rows = zip(FRAMES, BOXES.tolist(), strict=True)
    path.write_text("".join(f"{f + 1},-1,{','.join(map(repr, b))},0.9,-1,-1,-1\n" for f, b in rows))
    piece = boxes_of_one(path)
    assert (piece.first_index, piece.layout) == (1, "ltwh")
    _assert_boxes(piece, first=1)
    np.testing.assert_array_equal(piece.scores, 0.9)


def test_motchallenge_truth_leaves_out_what_is_not_counted(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,1,10,10,20,40,1,1,0.8\n1,2,50,10,20,40,0,1,1\n1,3,90,10,20,40,1,8,1\n")
    piece = boxes_of_one(path)
    assert piece.format == "MOTChallenge ground truth"
    np.testing.assert_array_equal(piece.boxes, [[10, 10, 20, 40]])


def test_places_of_motchallenge_3d(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,4,1,2,3,4,1,0.5,0.25,0\n2,4,1,2,3,4,1,0.75,0.25,0\n")
    truth = next(p for p in read(path)[1] if isinstance(p, TruthPiece))
    np.testing.assert_array_equal(truth.positions, [[0.5, 0.25, 0], [0.75, 0.25, 0]])
    np.testing.assert_array_equal(truth.ids, [4, 4])


def test_coco_results(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    records = [
        {"image_id": int(f), "category_id": 1, "bbox": b, "score": 0.8}
        for f, b in zip(FRAMES, BOXES.tolist(), strict=True)
    ]
    other = {"image_id": 0, "category_id": 3, "bbox": [1, 1, 9, 9], "score": 0.9}
    path.write_text(json.dumps([*records, other]))
    _assert_boxes(boxes_of_one(path))


def test_a_coco_data_set_has_a_camera_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "annotations.json"
    images = [
        {"id": 10 * c + n, "file_name": f"cam{c}/frame_{n:04}.jpg", "width": 640, "height": 480}
        for c in (1, 2) for n in (0, 1)
    ]  # fmt: skip
    annotations = [
        {"id": n, "image_id": image["id"], "category_id": 7, "bbox": [n, 0, 10, 20]}
        for n, image in enumerate(images)
    ]
    path.write_text(
        json.dumps({"images": images, "annotations": annotations,
                    "categories": [{"id": 7, "name": "person"}]})
    )  # fmt: skip
    pieces = boxes_in(path)
    assert [p.camera for p in pieces] == ["cam1", "cam2"]
    assert [p.frames.tolist() for p in pieces] == [[0, 1], [0, 1]]
    assert pieces[0].image_size == (640, 480)


@pytest.mark.parametrize(("faulty", "frames"), [(4, [0, 5, 10, 15, 20]), (1, [0, 1, 2, 3])])
def test_annotations_of_no_image_are_said(tmp_path: Path, faulty: int, frames: list[int]) -> None:
    """Where most ids are of no image they are numbers of frames; else what has none is left out."""
    images = [{"id": n, "file_name": f"frame_{n:06}.png"} for n in range(5)]
    ids = [0, 5, 10, 15, 20] if faulty > 1 else [0, 1, 2, 3, 99]
    annotations = [{"image_id": one, "bbox": [one, 0, 10, 20]} for one in ids]
    path = tmp_path / "annotations.json"
    path.write_text(json.dumps({"images": images, "annotations": annotations}))
    piece = boxes_of_one(path)
    assert piece.frames.tolist() == frames
    assert piece.boxes[:, 0].tolist() == frames
    assert ("80 %" if faulty > 1 else "1 of 5") in piece.left_out


def test_yolo_text_a_file_a_frame(tmp_path: Path) -> None:
    files = []
    for frame in np.unique(FRAMES):
        rows = []
        for box in BOXES[FRAMES == frame]:
            # parts of the picture from the corner of its first pixel
            centre = (box[:2] + 0.5 + box[2:] / 2.0) / SIZE
            rows.append(" ".join(map(repr, [0, *centre.tolist(), *(box[2:] / SIZE).tolist(), 0.5])))
        files.append(tmp_path / f"video_{frame + 1}.txt")
        files[-1].write_text("\n".join([*rows, "2 0.5 0.5 0.1 0.1 0.9"]))
    piece = boxes_of_one(files[0], *files)
    assert (piece.layout, piece.normalised, piece.first_index) == ("cxcywh", True, 1)
    _assert_boxes(piece, 1e-6, first=1)
    np.testing.assert_array_equal(piece.scores, 0.5)


def test_results_of_ultralytics(tmp_path: Path) -> None:
    files = []
    for frame in np.unique(FRAMES):
        records = [
            {"name": "person", "class": 0, "confidence": 0.7,
             "box": dict(zip(("x1", "y1", "x2", "y2"), _corners(box), strict=True))}
            for box in BOXES[FRAMES == frame]
        ]  # fmt: skip
        files.append(tmp_path / f"frame{frame}.json")
        files[-1].write_text(json.dumps(records))
    piece = boxes_of_one(files[0], *files)
    assert piece.format == "Ultralytics results"
    _assert_boxes(piece)


@pytest.mark.parametrize("index", [True, False], ids=["pandas", "polars"])
def test_tables_of_ultralytics(tmp_path: Path, index: bool) -> None:
    """With the box as Python writes it, in one cell; data frames of pandas number their rows, those
    of polars have tracks and key points here."""
    files = []
    for frame in np.unique(FRAMES):
        head = _HEAD if index else [*_HEAD, "track_id", "keypoints"]
        rows = [["", *head] if index else head]
        for number, box in enumerate(BOXES[FRAMES == frame]):
            corners = dict(zip(("x1", "y1", "x2", "y2"), _corners(box), strict=True))
            row = ["person", 0, 0.7, repr(corners)]
            pose = repr({"x": [1.0, 2.0], "y": [3.0, 4.0], "visible": [0.9, 0.8]})
            rows.append([number, *row] if index else [*row, number + 1, pose])
        files.append(tmp_path / f"frame{frame}.csv")
        with files[-1].open("w", newline="") as file:
            csv.writer(file).writerows(rows)
    piece = boxes_of_one(files[0], *files)
    assert (piece.format, piece.layout) == ("Ultralytics results", "xyxy")
    _assert_boxes(piece)
    np.testing.assert_array_equal(piece.scores, 0.7)


_HEAD = ["name", "class", "confidence", "box"]


def test_a_sink_of_supervision_with_a_detectors_own_columns(tmp_path: Path) -> None:
    """Names of classes, and what else the detections carry, follow the columns of every sink."""
    path = tmp_path / "out.csv"
    head = ["x_min", "y_min", "x_max", "y_max", "class_id", "confidence", "tracker_id",
            "class_name", "frame_index", "processing_time"]  # fmt: skip
    rows = [
        [*_corners(b), 0, 0.6, n, "person", int(f), 0.02]
        for n, (f, b) in enumerate(zip(FRAMES, BOXES, strict=True))
    ]
    other = [1, 1, 9, 9, 56, 0.9, 99, "chair", 0, 0.02]
    path.write_text("\n".join(",".join(map(str, row)) for row in [head, other, *rows]))
    piece = boxes_of_one(path)
    assert piece.format == "supervision sink"
    _assert_boxes(piece)


def test_a_sink_without_frames_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    path.write_text("x_min,y_min,x_max,y_max,class_id,confidence,tracker_id\n1,2,30,40,0,0.9,\n")
    with pytest.raises(FormatError, match='expected a column "frame"'):
        read(path)


@pytest.mark.parametrize("form", ["csv", "json"])
def test_sinks_of_supervision(tmp_path: Path, form: str) -> None:
    names = ["x_min", "y_min", "x_max", "y_max", "class_id", "confidence", "tracker_id",
             "frame_number"]  # fmt: skip
    rows = [[*_corners(b), 0, 0.6, "", int(f)] for f, b in zip(FRAMES, BOXES, strict=True)]
    path = tmp_path / f"out.{form}"
    if form == "csv":
        path.write_text("\n".join(",".join(map(str, row)) for row in [names, *rows]))
    else:
        path.write_text(json.dumps([dict(zip(names, row, strict=True)) for row in rows]))
    piece = boxes_of_one(path)
    assert (piece.format, piece.layout) == ("supervision sink", "xyxy")
    _assert_boxes(piece)


def test_csv_with_columns_in_any_order_and_several_cameras(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    head = "Height;Camera;Width;Frame ID;Top;note;Left"
    rows = [
        f"{b[3]!r};{camera};{b[2]!r};{f};{b[1]!r};x;{b[0]!r}"
        for camera in ("north", "south")
        for f, b in zip(FRAMES, BOXES.tolist(), strict=True)
    ]
    path.write_text("\n".join([head, *rows]))
    pieces = boxes_in(path)
    assert [p.camera for p in pieces] == ["north", "south"]
    for piece in pieces:
        _assert_boxes(piece)


def test_four_numbers_without_names_leave_the_layout_open(tmp_path: Path) -> None:
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps([{"frame": 0, "bbox": [1, 2, 3, 4], "score": 1.0}] * 3))
    assert boxes_of_one(path).layout is None


def _rows(first: int = 0) -> list[list[float]]:
    return [[f + first, *b] for f, b in zip(FRAMES.tolist(), BOXES.tolist(), strict=True)]


def test_blanks_for_commas_and_a_header_that_is_a_comment(tmp_path: Path) -> None:
    path = tmp_path / "cam1.txt"
    lines = ["  ".join([f"{f:.0f}", "7", *map(repr, b), "0.5"]) for f, *b in _rows()]
    path.write_text("\n".join(["# frame id x y w h score", *lines]))
    piece = boxes_of_one(path)
    assert piece.layout is None  # x and y are the middle where Ultralytics writes them
    _assert_boxes(piece)
    np.testing.assert_array_equal(piece.scores, 0.5)


def test_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "cam1.csv"
    lines = [";".join(repr(v).replace(".", ",") for v in row) for row in _rows()]
    text = "\r\n".join(["Frame;Left;Top;Width;Height", *lines])
    path.write_text(text.replace(",0;", ";", 1), encoding="utf-8-sig")
    _assert_boxes(boxes_of_one(path))


def test_decimal_commas_between_blanks(tmp_path: Path) -> None:
    """As programs in C write text where the decimal sign is a comma."""
    path = tmp_path / "det.txt"
    rows = zip(FRAMES, BOXES.tolist(), strict=True)
    lines = [f"{f + 1} -1 {' '.join(map(repr, b))} 0.9 -1 -1 -1" for f, b in rows]
    path.write_text("\n".join(lines).replace(".", ","))
    piece = boxes_of_one(path)
    assert piece.format == "MOTChallenge detections"
    _assert_boxes(piece, first=1)
    np.testing.assert_array_equal(piece.scores, 0.9)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "cp1252"])
def test_tables_as_excel_and_older_programs_write_them(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "cam1.txt"
    lines = ["\t".join(map(repr, [*row, "Gerät für Höhe"])) for row in _rows()]
    mark = "\ufeff" if encoding == "utf-16-le" else ""
    text = mark + "\r\n".join(["frame\tleft\ttop\twidth\theight\tnote", *lines])
    path.write_bytes(text.encode(encoding))
    _assert_boxes(boxes_of_one(path))


def test_pictures_by_their_paths_tell_the_camera(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    rows = [
        f"data/{camera}/frame_{f:05.0f}.jpg,{b[0]!r},{b[1]!r},{b[2]!r},{b[3]!r}"
        for camera in ("north", "south")
        for f, *b in _rows()
    ]
    path.write_text("\n".join(["image_path,left,top,width,height", *rows]))
    pieces = boxes_in(path)
    assert [p.camera for p in pieces] == ["data/north", "data/south"]
    for piece in pieces:
        _assert_boxes(piece)


def test_times_of_day(tmp_path: Path) -> None:
    path = tmp_path / "cam1.csv"
    lines = [f"00:01:{f / 25.0:06.3f},{','.join(map(repr, b))}" for f, *b in _rows()]
    path.write_text("\n".join(["timecode,left,top,width,height", *lines]))
    piece = boxes_of_one(path)
    assert piece.fps == pytest.approx(25.0, rel=1e-3)
    np.testing.assert_array_equal(piece.frames, FRAMES + 60 * 25)


def test_a_camera_s_number_is_no_frame(tmp_path: Path) -> None:
    """Tables without frames, a file a camera, are not taken for a file a frame."""
    files = [tmp_path / f"cam{number}.csv" for number in (1, 2)]
    for path in files:
        path.write_text("left,top,width,height\n1,2,30,40\n5,6,30,40\n")
    with pytest.raises(FormatError, match=r'cam1\.csv: expected a column "frame"'):
        read(files[0], *files)


@pytest.mark.parametrize("sign", [",", " ", "; "])
def test_five_numbers_without_a_header(tmp_path: Path, sign: str) -> None:
    path = tmp_path / "cam1.csv"
    path.write_text("\n".join(sign.join(map(repr, row)) for row in _rows()))
    piece = boxes_of_one(path)
    assert piece.layout is None
    _assert_boxes(piece)


@pytest.mark.parametrize(
    ("name", "scale"), [("time", 1.0), ("timestamp_ms", 1000.0), ("frame", 1.0)]
)
@pytest.mark.parametrize("fps", [2.0, 29.97])
def test_times_in_place_of_frames(tmp_path: Path, name: str, scale: float, fps: float) -> None:
    """Rounded to milliseconds, and nobody is seen for a while."""
    path = tmp_path / "cam1.csv"
    rows = [[round(f / fps, 3) * scale, *b] for f, *b in _rows()]
    lines = [",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join([f"{name},left,top,width,height", *lines]))
    piece = boxes_of_one(path)
    assert piece.fps == pytest.approx(fps, rel=1e-3)
    assert piece.first_index == 0
    _assert_boxes(piece)


def test_times_that_are_none_since_a_beginning(tmp_path: Path) -> None:
    path = tmp_path / "cam1.csv"
    path.write_text("time,left,top,width,height\n1.7e7,1,2,3,4\n1.7000001e7,1,2,3,4\n")
    with pytest.raises(FormatError, match=r'cam1\.csv.*time.*since the beginning.*"frame"'):
        boxes_of_one(path)


def test_a_record_a_line(tmp_path: Path) -> None:
    path = tmp_path / "boxes.jsonl"
    by_frame: dict[int, list[dict[str, object]]] = {}
    for frame, *box in _rows():
        found = {"bbox": box, "score": 0.5, "label": "person"}
        by_frame.setdefault(int(frame), []).append(found)
    lines = [
        json.dumps({"frame": frame, "camera": "cam1", "detections": found})
        for frame, found in by_frame.items()
    ]
    path.write_text("\n".join(lines))
    piece = boxes_of_one(path)
    assert piece.camera == "cam1"
    _assert_boxes(piece)
    path.write_text("\n".join([*lines[:3], lines[3][:-9]]))
    found, _, complaint = recognise(SourceFile(path))
    assert found is None
    assert "is not valid JSON" in str(complaint)


def _by_frame(rows: list[list[float]]) -> dict[str, list[list[float]]]:
    """Frame → lists, also of the frames in which nobody is."""
    table: dict[str, list[list[float]]] = {str(frame): [] for frame in range(len(walks()))}
    for frame, row in zip(FRAMES.tolist(), rows, strict=True):
        table[str(frame)].append(row)
    return table


WITH_SCORE = [[*_corners(box), 0.75] for box in BOXES]
BY_FRAME = _by_frame(WITH_SCORE)
NAMED = ("x1", "y1", "x2", "y2", "score")


@pytest.mark.parametrize(
    "content",
    [
        {"cam1": BY_FRAME, "cam2": BY_FRAME},
        {f: {"cam1": rows, "cam2": rows} for f, rows in BY_FRAME.items()},
        {"results": {"cam1": list(BY_FRAME.values()), "cam2": list(BY_FRAME.values())}},
        [{"cam1": rows, "cam2": rows} for rows in BY_FRAME.values()],
        {
            camera: {
                f"frame_{int(f):06d}": [dict(zip(NAMED, row, strict=True)) for row in rows]
                for f, rows in BY_FRAME.items()
            }
            for camera in ("cam1", "cam2")
        },
        {
            camera: {
                f: {"bboxes": [r[:4] for r in rows], "scores": [r[4] for r in rows]}
                for f, rows in BY_FRAME.items()
            }
            for camera in ("cam1", "cam2")
        },
        {
            f"{camera}/{int(f):08d}.jpg": [[*row, 0] for row in rows]
            for camera in ("cam1", "cam2")
            for f, rows in BY_FRAME.items()
        },
        {
            camera: [
                {"frame": int(f), "bbox": row[:4], "score": row[4]}
                for f, rows in BY_FRAME.items()
                for row in rows
            ]
            for camera in ("cam1", "cam2")
        },
    ],
    ids=[
        "camera, frame", "frame, camera", "lists of frames", "list of tables", "named fields",
        "lists beside each other", "pictures", "records",
    ],
)  # fmt: skip
def test_boxes_by_camera_and_frame(tmp_path: Path, content: object) -> None:
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps(content))
    name, pieces = read(path)
    assert name == "boxes by camera and frame (JSON, XML)"
    first, second = (piece for piece in pieces if isinstance(piece, DetectionPiece))
    assert (first.camera, second.camera) == ("cam1", "cam2")
    for piece in (first, second):
        order = np.argsort(piece.frames, kind="stable")
        np.testing.assert_array_equal(piece.frames[order], FRAMES)
        found = read_boxes(piece.boxes[order], "xyxy", None)
        np.testing.assert_allclose(found, BOXES, atol=1e-9)
        np.testing.assert_array_equal(piece.scores, 0.75)


CORNERS = [_corners(box) for box in BOXES]
MIDDLES = [[left + w / 2, top + h / 2, w, h] for left, top, w, h in BOXES.tolist()]


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        (
            "names of another language and decimal commas",
            [
                ["Bild;Links;Oben;Breite;Hoehe;Wert"],
                *(
                    [";".join(str(v).replace(".", ",") for v in (int(f), *b, 0.75))]
                    for f, b in zip(FRAMES, BOXES.tolist(), strict=True)
                ),
            ],
        ),
        (
            "a score and no names",
            [[f, *b, 0.75] for f, b in zip(FRAMES, BOXES.tolist(), strict=True)],
        ),
        (
            "a person before the box and zeros behind it",
            [
                [f, 7 + n % 2, *b, *[0] * 5]
                for n, (f, b) in enumerate(zip(FRAMES, BOXES.tolist(), strict=True))
            ],
        ),
        (
            "a person behind the box",
            [
                [f, *b, 7 + n % 2]
                for n, (f, b) in enumerate(zip(FRAMES, BOXES.tolist(), strict=True))
            ],
        ),
    ],
)  # fmt: skip
def test_rows_of_numbers_without_known_names(tmp_path: Path, name: str, rows: list[object]) -> None:
    path = tmp_path / "cam1.tsv"
    path.write_text("\n".join("\t".join(map(str, row)) for row in rows))  # type: ignore[call-overload]
    piece = boxes_of_one(path)
    assert piece.layout is None
    assert (piece.scores == (0.75 if "comma" in name or "score" in name else 1.0)).all()
    _assert_boxes(piece)


@pytest.mark.parametrize("header", ["Kamera;Klasse;Bild;Links;Oben;Breite;Hoehe", ""])
def test_words_between_numbers_are_cameras_or_classes(tmp_path: Path, header: str) -> None:
    path = tmp_path / "alle.csv"
    rows = [
        ";".join([camera, "person", f"{f:.0f}", *map(repr, b)])
        for camera in ("north", "south")
        for f, *b in _rows()
    ]
    path.write_text("\n".join([*filter(None, [header]), *rows]))
    pieces = boxes_in(path)
    assert [p.camera for p in pieces] == ["north", "south"]
    for piece in pieces:
        _assert_boxes(piece)


@pytest.mark.parametrize("cell", ["0.9", "90 %"])
def test_a_table_without_boxes_says_what_is_missing(tmp_path: Path, cell: str) -> None:
    path = tmp_path / "cam1.csv"
    path.write_text(f"frame,x,score\n0,{cell},{cell}\n1,{cell},{cell}\n")
    found, _, complaint = recognise(SourceFile(path))
    assert found is None
    assert 'is a table of "frame, x, score", among which are neither boxes' in str(complaint)


SCORES = np.linspace(0.25, 0.75, len(FRAMES))
ARRAYS: dict[str, Callable[[Path], object]] = {
    "rows": lambda path: np.save(path, np.column_stack([FRAMES, BOXES, SCORES])),
    "a structure": lambda path: np.save(
        path,
        np.rec.fromarrays([FRAMES, *BOXES.T, SCORES], names="frame,left,top,width,height,conf"),
    ),
    "columns": lambda path: np.savez(path, frames=FRAMES, boxes=BOXES, scores=SCORES),
    "cameras": lambda path: np.savez_compressed(
        path, north=np.column_stack([FRAMES, BOXES, SCORES]), notes=np.zeros(3)
    ),
}


@pytest.mark.parametrize("form", ARRAYS)
def test_arrays_of_numpy(tmp_path: Path, form: str) -> None:
    ARRAYS[form](tmp_path / "cam1")
    (path,) = tmp_path.iterdir()
    piece = boxes_of_one(path)
    _assert_boxes(piece)
    np.testing.assert_array_equal(piece.scores, SCORES)
    assert piece.camera == ("north" if form == "cameras" else "")


@pytest.mark.parametrize("change", ["cut", "another size", "objects"])
def test_spoilt_arrays_of_numpy_are_none(tmp_path: Path, change: str) -> None:
    path = tmp_path / "cam1.npy"
    np.save(path, np.column_stack([FRAMES, BOXES]))
    data = path.read_bytes()
    if change == "cut":
        path.write_bytes(data[:-8])
    elif change == "another size":
        size = str(len(FRAMES)).encode()
        path.write_bytes(data.replace(size + b", 5", b"9" * 15 + b", 5", 1))
    else:
        np.save(path, np.array([{}, {}]), allow_pickle=True)
    found, _, complaint = recognise(SourceFile(path))
    assert found is None
    assert "NumPy array" in str(complaint)


def test_rows_of_a_sensor_are_no_boxes(tmp_path: Path) -> None:
    """Numbers of both signs under names of an accelerometer."""
    path = tmp_path / "imu.csv"
    rows = np.random.default_rng(1).normal(0.0, 9.0, (50, 6))
    lines = [",".join(map(str, (n, *row))) for n, row in enumerate(rows.tolist())]
    path.write_text("\n".join(["tick,ax,ay,az,gx,gy,gz", *lines]))
    assert recognise(SourceFile(path))[0] is None


def test_rows_that_become_others_further_down_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "cam1.txt"
    lines = [
        "\t".join(map(str, (n // 2, 10 + n % 7, 20 + n % 5, 300 + n % 2, 400 + n % 3)))
        for n in range(9000)
    ]
    path.write_text("\n".join([*lines, "1\t2"]))
    with pytest.raises(FormatError, match=r"cam1\.txt: expected rows of the same count"):
        boxes_of_one(path)


def test_labels_of_kitti_s_tracking(tmp_path: Path) -> None:
    path = tmp_path / "0000.txt"
    rows = [
        f"{f} 3 Pedestrian 0 0 -1.5 {' '.join(map(repr, c))} 1.7 .6 .8 1 2 9 -1.6"
        for f, c in zip(FRAMES, CORNERS, strict=True)
    ]
    path.write_text("\n".join([*rows, "0 -1 DontCare -1 -1 -10 1 1 90 90 -1 -1 -1 -1 -1 -1 -1"]))
    piece = boxes_of_one(path)
    assert "1 of" in piece.left_out
    _assert_boxes(piece)


def test_text_of_vatic_leaves_out_who_is_out_of_sight(tmp_path: Path) -> None:
    """The ten columns end with a name, as those of COLMAP's poses do."""
    path = tmp_path / "view1.txt"
    rows = [
        f'{n % 2} {" ".join(map(repr, c))} {f} 0 0 1 "PERSON"'
        for n, (f, c) in enumerate(zip(FRAMES, CORNERS, strict=True))
    ]
    path.write_text("\n".join([*rows, '0 1 1 90 90 9 1 0 0 "PERSON"']))
    assert read(path)[0] == "VATIC text"
    _assert_boxes(boxes_of_one(path))


@pytest.mark.parametrize("by", ["middle", "corner"])
def test_boxes_in_xml_by_frame(tmp_path: Path, by: str) -> None:
    """CAVIAR and PETS, and UA-DETRAC, have frames of several people and of one."""
    objects: dict[int, str] = {}
    for f, (cx, cy, w, h), (left, top, *_) in zip(FRAMES.tolist(), MIDDLES, CORNERS, strict=True):
        box = (
            f'<object id="1"><box xc="{cx!r}" yc="{cy!r}" w="{w!r}" h="{h!r}"/></object>'
            if by == "middle"
            else f'<target id="1"><box left="{left!r}" top="{top!r}" width="{w!r}" height="{h!r}"/>'
            "</target>"
        )
        objects[f] = objects.get(f, "") + box
    level, number = ("objectlist", "number") if by == "middle" else ("target_list", "num")
    frames = "".join(
        f'<frame {number}="{f}"><{level}>{own}</{level}></frame>' for f, own in objects.items()
    )
    path = tmp_path / "cam1.xml"
    path.write_text(f'<?xml version="1.0"?><dataset name="a walk">{frames}</dataset>')
    _assert_boxes(boxes_of_one(path), 1e-6)


def test_a_time_that_all_boxes_of_a_file_share_is_no_frame(tmp_path: Path) -> None:
    """How long the detector took, beside the boxes of a file a frame (Roboflow)."""
    paths = []
    for f in sorted(set(FRAMES.tolist())):
        own = [m for g, m in zip(FRAMES, MIDDLES, strict=True) if g == f]
        boxes_ = [
            dict(zip(("x", "y", "width", "height"), m, strict=True), confidence=0.5) for m in own
        ]
        paths.append(tmp_path / f"frame_{f:05}.json")
        paths[-1].write_text(json.dumps({"time": 0.1 + f / 1e3, "predictions": boxes_}))
    piece = boxes_of_one(paths[0], *paths)
    found = read_boxes(piece.boxes, "cxcywh", None)
    np.testing.assert_array_equal(piece.frames, FRAMES)
    np.testing.assert_allclose(found, BOXES, atol=1e-9)


def test_a_file_a_camera_whose_boxes_have_times(tmp_path: Path) -> None:
    """The numbers of the files are the cameras' and not those of frames (Rekognition)."""
    names = ("Left", "Top", "Width", "Height")
    parts = (BOXES + np.array([0.5, 0.5, 0.0, 0.0])) / np.array(
        [*SIZE, *SIZE]
    )  # from the corner of a pixel
    people = [
        {"Timestamp": 40 * f, "Person": {"BoundingBox": dict(zip(names, b, strict=True))}}
        for f, b in zip(FRAMES.tolist(), parts.tolist(), strict=True)
    ]
    paths = [tmp_path / f"cam{number}.json" for number in (1, 2)]
    for path in paths:
        path.write_text(json.dumps({"Persons": people}))
    pieces = boxes_in(paths[0], *paths)
    assert [piece.source.name for piece in pieces] == ["cam1.json", "cam2.json"]
    for piece in pieces:
        assert piece.fps == pytest.approx(25.0)
        _assert_boxes(piece, 1e-6)


@pytest.mark.parametrize("written", ["iso", "s", "ms", "us", "ns"])
def test_times_with_dates_are_counted_from_the_first_of_all_files(
    tmp_path: Path, written: str
) -> None:
    """Two cameras, of which the second sees somebody a second later."""
    paths = [tmp_path / f"cam{number}.csv" for number in (1, 2)]
    begin = datetime(2024, 5, 1, 12, tzinfo=UTC)
    parts = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}.get(written, 1)
    for path, later in zip(paths, (0, 25), strict=True):
        whens = [begin + timedelta(milliseconds=40 * (int(f) + later)) for f in FRAMES]
        times = [w.isoformat() if written == "iso" else w.timestamp() * parts for w in whens]
        rows = [",".join(map(str, (w, *b))) for w, b in zip(times, BOXES.tolist(), strict=True)]
        path.write_text("\n".join(["timestamp,left,top,width,height", *rows]))
    first, second = on_one_clock([boxes_of_one(path) for path in paths])
    assert first.fps == pytest.approx(25.0, rel=1e-3)
    _assert_boxes(first)
    _assert_boxes(second, first=25)
    assert second.last_frame == FRAMES.max() + 25


def test_boxes_by_frame_are_a_camera_a_file_or_a_frame_a_file(tmp_path: Path) -> None:
    files = [tmp_path / f"cam{number}.json" for number in (1, 2)]
    for path in files:
        path.write_text(json.dumps(BY_FRAME))
    pieces = read(files[0], *files)[1]
    assert [piece.source for piece in pieces] == files  # type: ignore[union-attr]
    frames = [tmp_path / f"{int(frame):06d}.json" for frame in BY_FRAME]
    for path, rows in zip(frames, BY_FRAME.values(), strict=True):
        lists = {"labels": [0] * len(rows), "scores": [r[4] for r in rows]}
        path.write_text(json.dumps({**lists, "bboxes": [r[:4] for r in rows]}))
    piece = boxes_of_one(frames[0], *frames)
    np.testing.assert_array_equal(piece.frames, FRAMES)
    assert (piece.last_frame, piece.first_index) == (len(walks()) - 1, 0)


def test_people_by_number_are_no_cameras(tmp_path: Path) -> None:
    path = tmp_path / "tracks.json"
    people = {f: {str(n): row[:4] for n, row in enumerate(rows)} for f, rows in BY_FRAME.items()}
    path.write_text(json.dumps(people))
    piece = boxes_of_one(path)
    assert (piece.camera, len(piece.frames)) == ("", len(FRAMES))


def test_other_classes_in_lists_of_six_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "boxes.json"
    rows = {f: [[*row, kind] for row in rows for kind in (0, 56)] for f, rows in BY_FRAME.items()}
    path.write_text(json.dumps(rows))
    np.testing.assert_array_equal(boxes_of_one(path).frames, FRAMES)


@pytest.mark.parametrize(
    "content",
    [
        {"cam1": {"R": [[1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 1, 4]], "size": [640, 480]}},
        {"0": {"q": [0.1, 0.2, 0.3, 0.4]}, "1": {"q": [0.1, 0.2, 0.3, 0.4]}},
        {"cam1": [[1, 2, 3, 4], [1, 2, 3, 4]], "cam2": [[1, 2, 3, 4]]},
        {"0": [[1, 2, 3], [4, 5, 6]]},
    ],
    ids=["poses", "rotations", "no frames", "points"],
)
def test_lists_of_something_else_are_no_boxes(tmp_path: Path, content: object) -> None:
    path = tmp_path / "something.json"
    path.write_text(json.dumps(content))
    found, _, _ = recognise(SourceFile(path))
    assert found is None or found.KIND != "detections"


def test_a_number_that_is_none_is_named_by_its_row(tmp_path: Path) -> None:
    path = tmp_path / "cam1.txt"
    path.write_text("1,-1,1,2,3,4,1\n2,-1,1e300,2,3,4,1\n")
    with pytest.raises(FormatError) as told:
        read(path)
    assert str(told.value).startswith("cam1.txt, row 2: expected finite numbers, found ")
    assert "1e300" in str(told.value)
    assert str(told.value).endswith("; correct or remove the row")


def test_a_column_of_boxes_may_have_any_of_their_names(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    path.write_text('frame,camera,score,xyxy\n0,a,0.9,"[1, 2, 30, 40]"\n4,a,0.8,"[2, 2, 30, 40]"\n')
    (piece,) = read(path)[1]
    assert isinstance(piece, DetectionPiece)
    np.testing.assert_array_equal(piece.boxes, [[1, 2, 30, 40], [2, 2, 30, 40]])
    np.testing.assert_array_equal(piece.frames, [0, 4])


def test_every_name_of_people_counts_in_every_table() -> None:
    assert people(["player", "ball", "Woman "]).tolist() == [True, False, True]
    assert people(["1", "0", "2"]).tolist() == [False, True, False]
    assert people(["1", "2"]).tolist() == [True, False]

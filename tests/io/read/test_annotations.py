"""Boxes of annotation programs and tables of columns; and what is refused by its name."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from tests.io.read.rig import SIZE, boxes, boxes_of_one, cameras, read, walks
from tracker.io.conventions.reading import read_boxes
from tracker.io.read.pieces import DetectionPiece, FormatError
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile

CAMERA = cameras()[0]
FRAMES, BOXES = boxes(CAMERA, walks())
STEPS = len(walks())


def _assert_boxes(piece: DetectionPiece, tolerance: float = 1e-9) -> None:
    found = read_boxes(piece.boxes, piece.layout or "ltwh", SIZE if piece.normalised else None)
    order = np.argsort(piece.frames, kind="stable")
    np.testing.assert_array_equal(piece.frames[order], FRAMES)
    np.testing.assert_allclose(found[order], BOXES, atol=tolerance)


def _of(frame: int) -> list[list[float]]:
    return BOXES[frame == FRAMES].tolist()


def test_labelme(tmp_path: Path) -> None:
    files = []
    for frame in range(STEPS):
        shapes = [
            {"label": "person", "shape_type": "rectangle", "points": [[x + w, y], [x, y + h]]}
            for x, y, w, h in _of(frame)
        ]
        point = {"label": "person", "shape_type": "point", "points": [[1, 2]]}
        content = {"version": "5.4.1", "flags": {}, "shapes": [*shapes, point], "imageData": None,
                   "imageWidth": SIZE[0], "imageHeight": SIZE[1]}  # fmt: skip
        files.append(tmp_path / f"frame_{frame:05d}.json")
        files[-1].write_text(json.dumps(content))
    piece = boxes_of_one(files[0], *files)
    _assert_boxes(piece)
    assert (piece.format, piece.image_size) == ("LabelMe JSON", SIZE)
    assert (piece.first_index, piece.last_frame) == (0, STEPS - 1)


def test_pascal_voc(tmp_path: Path) -> None:
    files = []
    for frame in range(STEPS):
        corners = [(x, y, x + w, y + h) for x, y, w, h in _of(frame)]
        objects = "".join(
            f"<object><name>{name}</name><bndbox><xmin>{left!r}</xmin><ymin>{top!r}</ymin>"
            f"<xmax>{right!r}</xmax><ymax>{bottom!r}</ymax></bndbox></object>"
            for left, top, right, bottom in corners
            for name in ("person", "chair")
        )
        files.append(tmp_path / f"{frame:06d}.xml")
        files[-1].write_text(
            f"<annotation><filename>{frame:06d}.jpg</filename><size><width>{SIZE[0]}</width>"
            f"<height>{SIZE[1]}</height></size>{objects}</annotation>"
        )
    piece = boxes_of_one(files[0], *files)
    _assert_boxes(piece)
    assert (piece.format, piece.image_size) == ("Pascal VOC XML", SIZE)


def _via(frame: int) -> list[dict[str, object]]:
    """Regions of a frame: rectangles of people, and a point and a chair, which count for none."""
    regions: list[dict[str, object]] = [
        {
            "shape_attributes": {"name": "rect", "x": x, "y": y, "width": w, "height": h},
            "region_attributes": {"seen": True, "class": "person"},
        }
        for x, y, w, h in _of(frame)
    ]
    chair = {"name": "circle", "cx": 50, "cy": 60, "r": 10}
    return [
        *regions,
        {"shape_attributes": {"name": "point", "cx": 1, "cy": 2}, "region_attributes": {}},
        {"shape_attributes": chair, "region_attributes": {"class": "chair"}},
    ]


@pytest.mark.parametrize("form", ["project", "annotations", "version 1", "csv"])
def test_vgg_image_annotator(tmp_path: Path, form: str) -> None:
    pictures = {}
    lines = ["filename,file_size,file_attributes,region_count,region_id,region_shape_attributes,"
             "region_attributes"]  # fmt: skip
    for frame in range(STEPS):
        name, regions = f"cam1/{frame:06d}.jpg", _via(frame)
        listed = {str(n): one for n, one in enumerate(regions)} if form == "version 1" else regions
        pictures[f"{name}99"] = {"filename": name, "size": 99, "regions": listed,
                                 "file_attributes": {}}  # fmt: skip
        for n, one in enumerate(regions):
            told = (json.dumps(one[part]) for part in ("shape_attributes", "region_attributes"))
            cells = ",".join('"' + cell.replace('"', '""') + '"' for cell in told)
            lines.append(f'{name},99,"{{}}",{len(regions)},{n},{cells}')
    path = tmp_path / ("via.csv" if form == "csv" else "via.json")
    project = {"_via_settings": {"ui": {}}, "_via_img_metadata": pictures, "_via_attributes": {}}
    content = json.dumps(project if form == "project" else pictures)
    path.write_text("\n".join(lines) if form == "csv" else content)
    piece = boxes_of_one(path)
    _assert_boxes(piece)
    assert (piece.format, piece.camera) == ("VGG Image Annotator JSON or CSV", "cam1")
    assert (piece.first_index, piece.last_frame) == (0, STEPS - 1)


def test_shapes_of_vgg_image_annotator_and_what_is_wrong_with_one(tmp_path: Path) -> None:
    shapes = [
        {"name": "polygon", "all_points_x": [30, 10, 20], "all_points_y": [5, 25, 45]},
        {"name": "ellipse", "cx": 50, "cy": 60, "rx": 10, "ry": 20},
    ]
    picture = {"filename": "7.jpg", "size": 1, "file_attributes": {}, "regions": [
        {"shape_attributes": shape, "region_attributes": {}} for shape in shapes]}  # fmt: skip
    path = tmp_path / "via.json"
    path.write_text(json.dumps({"7.jpg1": picture}))
    np.testing.assert_allclose(boxes_of_one(path).boxes, [[10, 5, 30, 45], [40, 40, 60, 80]])
    shapes[1]["rx"] = "wide"
    path.write_text(json.dumps({"7.jpg1": picture}))
    with pytest.raises(FormatError, match=r"via.json, 7.jpg rx: expected numbers"):
        read(path)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('{"images": [], "annotations": {"id": 1}}', "annotations"),
        ('{"version": "5", "flags": {}, "shapes": {"id": 1}}', "shapes"),
        ('{"people": {"id": 1}, "pose_keypoints_2d": 0}', "people"),
        ('{"bodies": {"id": 1}, "joints19": 0}', "bodies"),
        ('{"personID": 1, "positionID": 1, "views": 1}', ""),
        ('{"0": {"object id": 1, "3d location": 1, "2d bounding box visible": 1}}', "frame 0"),
        (
            '{"timestamp": "2014-09-08T04:00:00Z", "objects": {"person": "bounding_box_px"}}\n'
            '{"timestamp": "2014-09-08T04:00:01Z", "objects": {"person": "bounding_box_px"}}',
            "line 1 objects",
        ),
    ],
)
def test_what_is_no_list_of_tables_is_named_by_file_and_field(
    tmp_path: Path, text: str, field: str
) -> None:
    path = tmp_path / "cam1.json"
    path.write_text(text)
    where = f"cam1.json, {field}" if field else "cam1.json"
    with pytest.raises(FormatError) as told:
        read(path)
    assert str(told.value).startswith(f"{where}: expected a list of tables, found ")
    assert str(told.value).endswith("get the file again")


@pytest.mark.parametrize("sides", [(0, 480), (1e9, 480), ("wide", 480), (None, 480), (640.5, 480)])
def test_a_size_of_no_picture_is_not_known(tmp_path: Path, sides: tuple[object, object]) -> None:
    shape = {"label": "person", "shape_type": "rectangle", "points": [[1, 2], [30, 80]]}
    label = {"flags": {}, "shapes": [shape], "imageWidth": sides[0], "imageHeight": sides[1]}
    path = tmp_path / "frame_7.json"
    path.write_text(json.dumps(label))
    assert boxes_of_one(path).image_size is None
    path.write_text(json.dumps({**label, "imageWidth": 640}))
    assert boxes_of_one(path).image_size == (640, 480)


def _percent(box: list[float]) -> dict[str, float]:
    # from the corner of the first pixel
    parts = np.add(box, [0.5, 0.5, 0.0, 0.0]) / (*SIZE, *SIZE)
    x, y, w, h = (100.0 * parts).tolist()
    return {"x": x, "y": y, "width": w, "height": h}


@pytest.mark.parametrize("small", [False, True])
def test_label_studio(tmp_path: Path, small: bool) -> None:
    tasks = []
    for frame in range(STEPS):
        sides = {"original_width": SIZE[0], "original_height": SIZE[1]}
        image = f"/data/upload/1/3ab2c4d5-cam1_{frame:05d}.jpg"
        values = [{**_percent(box), "rectanglelabels": ["Person"]} for box in _of(frame)]
        if small:
            tasks.append({"image": image, "label": [{**value, **sides} for value in values]})
        else:
            result = [{"type": "rectanglelabels", **sides, "value": value} for value in values]
            tasks.append({"data": {"image": image}, "annotations": [{"result": result}]})
    path = tmp_path / "project.json"
    path.write_text(json.dumps(tasks))
    piece = boxes_of_one(path)
    _assert_boxes(piece)
    assert (piece.camera, piece.image_size, piece.last_frame) == ("cam1", SIZE, STEPS - 1)


def test_label_studio_moves_boxes_between_key_frames(tmp_path: Path) -> None:
    keys = [
        {"frame": 1, "enabled": True, "x": 10, "y": 20, "width": 5, "height": 10},
        {"frame": 5, "enabled": False, "x": 30, "y": 20, "width": 5, "height": 10},
        {"frame": 9, "enabled": True, "x": 50, "y": 20, "width": 5, "height": 10},
    ]
    result = {"type": "videorectangle", "value": {"sequence": keys, "labels": ["Person"]}}
    task = {"data": {"video": "/data/upload/cam2.mp4"}, "annotations": [{"result": [result]}]}
    path = tmp_path / "project.json"
    path.write_text(json.dumps([task]))
    piece = boxes_of_one(path)
    assert (piece.camera, piece.first_index) == ("cam2", 1)
    np.testing.assert_array_equal(piece.frames, [1, 2, 3, 4, 5, 9])
    np.testing.assert_allclose(piece.boxes[:, 0], [0.1, 0.15, 0.2, 0.25, 0.3, 0.5])


def test_cvat(tmp_path: Path) -> None:
    tracks = "".join(
        f'<track id="{n}" label="person"><box frame="{f}" outside="{int(n % 5 == 4)}" '
        'xtl="{}" ytl="{}" xbr="{}" ybr="{}"/></track>'.format(
            *map(repr, (b[0], b[1], b[0] + b[2], b[1] + b[3]))
        )
        for n, (f, b) in enumerate(zip(FRAMES, BOXES.tolist(), strict=True))
    )
    path = tmp_path / "annotations.xml"
    path.write_text(
        "<?xml version='1.0' encoding='utf-8'?><annotations><version>1.1</version><meta><task>"
        "<name>cam 1</name><original_size><width>1280</width><height>720</height>"
        f"</original_size></task></meta>{tracks}</annotations>"
    )
    piece = boxes_of_one(path)
    kept = np.arange(len(FRAMES)) % 5 != 4
    np.testing.assert_array_equal(piece.frames, FRAMES[kept])
    np.testing.assert_allclose(read_boxes(piece.boxes, "xyxy"), BOXES[kept], atol=1e-9)
    assert (piece.camera, piece.image_size) == ("cam 1", SIZE)


def test_parquet(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    columns = {
        "frame": FRAMES,
        **dict(zip(("left", "top", "width", "height"), BOXES.T, strict=True)),
    }
    path = tmp_path / "boxes.parquet"
    pq.write_table(pa.table(columns), path)
    _assert_boxes(boxes_of_one(path))
    path.write_bytes(path.read_bytes()[:200])
    file = SourceFile(path)
    found, _, _ = recognise(file)
    assert found is not None
    with pytest.raises(ValueError, match="cannot be read as Parquet"):
        list(found.read(file))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("params.pickle", pickle.dumps({"cam": 1}), "Python pickle.*run what is in it"),
        ("boxes.h5", b"\x89HDF\r\n\x1a\n" + bytes(64), "HDF5.*as CSV"),
        ("a.txt", b"Homography matrix: 1 0 0;0 1 0;0 0 1\n", "homography.*solvePnP"),
        ("bundle.out", b"# Bundle file v0.3\n2 0\n", "Bundler.*COLMAP"),
        ("a.xcp", b'<Cameras SOURCE="Nexus"><Camera DEVICEID="21"/></Cameras>', "Vicon.*K, R and"),
        ("a.c3d", b"\x02\x50" + bytes(510), "C3D.*TRC"),
        ("take.csv", b"Format Version,1.23,Take Name,A\n\n", "Motive.*TRC"),
    ],
)
def test_what_is_not_read_is_called_by_its_name(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    found, _, complaint = recognise(SourceFile(path))
    assert found is None
    with pytest.raises(ValueError, match=words):
        raise complaint or AssertionError

"""What a field, a table or a calibration may hold: the last that is read, the first that is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tracker.files.text import shown
from tracker.sequences import csv_columns
from tracker.sequences.clock import Clock, read_timing
from tracker.sequences.csv_columns import Columns, guarded, read_columns, unguarded
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LONGEST_NAME, Fields, did_you_mean, is_number, listed
from tracker.sequences.reader import LONGEST_PATH, given_folder
from tracker.sequences.sequence import Room, View
from tracker.sequences.tables import BoxTable, truth_of
from tracker.sequences.views import POSE, check_view_of_room, read_camera
from tracker.sequences.writing.teaching import read_room, read_templates

EYE = np.eye(3).tolist()
K = [[500.0, 0.0, 99.5], [0.0, 500.0, 79.5], [0.0, 0.0, 1.0]]
NEXT_TO_A_MILLION = float(np.nextafter(1e6, np.inf))


def fields(**values: Any) -> Fields:
    return Fields("file", values, [*values, "missing"])


def refused(read: Callable[[], object]) -> bool:
    try:
        read()
    except SequenceError:
        return True
    return False


READERS: dict[str, Callable[[Any], object]] = {
    "rate": lambda v: fields(a=v).rate("a"),
    "text": lambda v: fields(a=v).text("a"),
    "count": lambda v: fields(a=v).integer("a"),
    "from 2 to 4": lambda v: fields(a=v).integer("a", minimum=2, maximum=4),
    "vector": lambda v: fields(a=[0.0, v]).vector("a", 2, "metres"),
    "positive": lambda v: fields(a=[1.0, v]).vector("a", 2, "metres", positive=True),
    "numbers": lambda v: fields(a=[v]).numbers("a"),
    "matrix": lambda v: fields(a=[[v, 0.0]]).matrix("a", 1, 2),
    "rows": lambda v: fields(a=v).matrix("a", 1, 2),
    "offset": lambda v: read_timing(fields(time_offset=v), Path(), "", None),
    "first_frame": lambda v: read_timing(fields(first_frame=v), Path(), "", None),
    "focal length across": lambda v: camera(K=_with(K, 0, 0, v)),
    "focal length down": lambda v: camera(K=_with(K, 1, 1, v)),
    "skew": lambda v: camera(K=_with(K, 0, 1, v)),
    "below the diagonal": lambda v: camera(K=_with(K, 2, 1, v)),
    "R": lambda v: camera(R=_with(EYE, 0, 0, v)),
    "numbers of distortion": lambda v: camera(distortion=[0.1] * v),
    "numbers of a fisheye": lambda v: camera(distortion=[0.1] * v, lens="fisheye"),
    "left of a template": lambda v: template(box=[v, 10.0, 20.0, 30.0]),
    "top of a template": lambda v: template(box=[10.0, v, 20.0, 30.0]),
    "width of a template": lambda v: template(box=[10.0, 10.0, v, 30.0]),
    "height of a template": lambda v: template(box=[10.0, 10.0, 20.0, v]),
    "right edge": lambda v: template(box=[v - 20.0, 10.0, 20.0, 30.0]),
    "lower edge": lambda v: template(box=[10.0, v - 30.0, 20.0, 30.0]),
    "step of a template": lambda v: template(frame=v),
    "height of a room": lambda v: room(v),
}  # fmt: skip

LIMITS: dict[str, tuple[list[Any], list[Any]]] = {
    "rate": ([0.0011, 1000.0, 25], [0.001, 1000.1, 0.0, True, "25", float("nan"), 10**400]),
    "text": (["a", "x" * 1000, " a  b "], ["", "  ", "x" * 1001, 3, "a\0b"]),
    "count": ([0, 10_000_000], [-1, 10_000_001, 0.0, True, False, "3"]),
    "from 2 to 4": ([2, 3, 4], [1, 5, 3.0, "3"]),
    "vector": ([1e6, -1e6, 0], [NEXT_TO_A_MILLION, -NEXT_TO_A_MILLION, True, float("inf")]),
    "positive": ([1e-4, 1e6], [0.0, np.nextafter(1e-4, 0.0), -1.0, NEXT_TO_A_MILLION]),
    "numbers": ([1e6, -1e6], [NEXT_TO_A_MILLION, "1"]),
    "matrix": ([1e12, -1e12], [1.0001e12, -1.0001e12, None]),
    "rows": ([[[1.0, 2.0]]], [3.0, [1.0, 2.0], [[1.0]], []]),
    "offset": ([86400.0, -86399.9], [86400.1, -86400.0]),
    "first_frame": ([0, 7], [-1]),
    "focal length across": ([0.1, 1e6], [0.0, -1.0, 0.0999, 1.0001e6]),
    "focal length down": ([0.1, 1e6], [0.0, -1.0, 0.0999, 1.0001e6]),
    "skew": ([1e6, -1e6], [1.0001e6, -1.0001e6]),
    "below the diagonal": ([0.0], [1e-9]),
    # R Rᵀ is off by twice what one entry is
    "R": ([1.00099, 0.99901], [1.0011, 0.9989, -1.0]),
    "numbers of distortion": ([0, 4, 5, 8], [1, 3, 6, 7, 9, 12, 14]),
    "numbers of a fisheye": ([0, 4], [1, 3, 5, 8]),
    "left of a template": ([-1.0, 0.0], [-1.01]),
    "top of a template": ([-1.0, 0.0], [-1.01]),
    "width of a template": ([2.0], [0.0, -2.0, 1.99]),
    "height of a template": ([2.0], [0.0, -2.0, 1.99]),
    "right edge": ([200.0, 201.0], [201.01]),
    "lower edge": ([160.0, 161.0], [161.01]),
    "step of a template": ([0, 7], [-1, 8]),
    "height of a room": ([1e-3], [0.0, -1.0]),
}


def _with(matrix: list[list[float]], row: int, column: int, value: float) -> list[list[float]]:
    result = [list(one) for one in matrix]
    result[row][column] = value
    return result


def camera(**values: Any) -> Any:
    table = {"K": K, "R": EYE, "t": [0.0, 0.0, 4.0]} | values
    return read_camera("cam1", (200, 160), Fields("file", table, [*POSE, "projection"]))


def template(**values: Any) -> Any:
    one = {"name": "a", "camera": "cam1", "frame": 0, "box": [10.0, 10.0, 20.0, 30.0]} | values
    seen = View(camera(), images=(Path("0.png"),))
    return read_templates(Fields("file", {"template": [one]}, ["template"]), (seen,), 8)


def room(height: float) -> Room:
    table = {"min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, height]}
    return read_room(Fields("file", {"room": table}, ["room"]))


@pytest.mark.parametrize("name", LIMITS)
def test_a_value_at_its_limit_is_read_and_one_beyond_refused(name: str) -> None:
    read, (good, bad) = READERS[name], LIMITS[name]
    assert [value for value in good if refused(lambda: read(value))] == []  # noqa: B023
    assert [value for value in bad if not refused(lambda: read(value))] == []  # noqa: B023


def test_a_field_that_is_missing_has_its_default_where_there_is_one() -> None:
    assert fields().text("missing", "plain") == "plain"
    assert fields().text("missing", "") == ""
    assert fields().integer("missing", 3) == 3
    assert fields().numbers("missing").shape == (0,)
    assert fields().tables("missing", ()) == []
    assert fields().table("missing", (), needed=False) is None
    for read in (
        lambda: fields().text("missing"), lambda: fields().integer("missing"),
        lambda: fields().rate("missing"), lambda: fields().matrix("missing", 1, 1),
        lambda: fields().vector("missing", 1, "metres"), lambda: fields().table("missing", ()),
    ):  # fmt: skip
        with pytest.raises(SequenceError, match=r'^file: field "missing" is missing'):
            read()


def test_what_a_table_holds_is_reported_and_its_tables_are_called_by_name() -> None:
    whole = fields(a=[{"name": "x"}, {"name": ""}, {}], b="text", c={"d": 1})
    assert ("a" in whole, "missing" in whole) == (True, False)
    assert [whole.is_list(name) for name in "abc"] == [True, False, False]
    assert [whole.is_text(name) for name in "abc"] == [False, True, False]
    called = [one.where for one in whole.tables("a", ("name",), "[[camera]]")]
    assert called == ['file, camera "x"', "file, camera 2", "file, camera 3"]
    inner = whole.table("c", ("d",))
    assert inner is not None
    assert (inner.where, inner.shown("d"), whole.shown("b")) == ("file, [c]", "1", '"text"')
    with pytest.raises(SequenceError, match="2 rows of 2 numbers, found 2 rows of 2 and 1"):
        fields(a=[[1, 2], [3]]).matrix("a", 2, 2)
    with pytest.raises(SequenceError, match="found 3"):
        fields(a=[1, 2, 3]).vector("a", 2, "metres")


def test_words_of_messages() -> None:
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert shown("x" * 58) == f'"{"x" * 58}"'
    assert shown("x" * 59) == f'"{"x" * 56}…'
    assert [shown(one) for one in (True, False, 1, 1.5)] == ["true", "false", "1", "1.5"]
    assert did_you_mean("Fram", ["frames", "fps"]) == '; did you mean "frames"?'
    assert did_you_mean("xyz", ["frames", "fps"]) == ""
    # three of ten letters in common are too few, six are enough
    assert did_you_mean("abcxy", ["abczw"]) != ""
    assert did_you_mean("abxyz", ["abcde"]) == ""
    assert [is_number(v, 2.0) for v in (2, -2.0, 2.001, -2.001, True)] == [1, 1, 0, 0, 0]
    largest = 1.7976931348623157e308
    assert [is_number(v, np.inf) for v in (largest, -largest, np.inf, 10**309)] == [1, 1, 0, 0]


# ── calibrations


def test_a_lens_is_filled_up_to_five_numbers_or_has_eight() -> None:
    given = [-0.3, 0.1, 0.001, 0.002, 0.2, 0.03, 0.02, 0.01]
    assert camera(distortion=given[:4]).distortion.tolist() == [*given[:4], 0.0]
    assert camera(distortion=given[:5]).distortion.tolist() == given[:5]
    assert camera(distortion=given).distortion.tolist() == given
    assert camera(distortion=[*given[:5], 0, 0, 0]).distortion.tolist() == given[:5]
    assert camera(distortion=[*given[:5], *[0.0] * 9]).distortion.tolist() == given[:5]
    assert camera(distortion=[*given, *[0.0] * 4]).distortion.tolist() == given
    assert camera(distortion=[0, 0, 0, 0, 0, 0, 0, 0.1]).distortion.tolist() == [0.0] * 7 + [0.1]
    assert camera().distortion.tolist() == [0.0] * 5
    eye = camera(lens="fisheye")
    assert (eye.fisheye, eye.distortion.tolist()) == (True, [0.0] * 4)
    assert camera(distortion=given[:4], lens="fisheye").distortion.tolist() == given[:4]


def test_a_projection_may_lie_so_far_away_and_no_further() -> None:
    def at(distance: float) -> Any:
        pose = np.column_stack([np.eye(3), [0.0, 0.0, distance]])
        table = {"projection": (np.array(K) @ pose).tolist()}
        return read_camera("cam1", (200, 160), Fields("file", table, [*POSE, "projection"]))

    assert_allclose(at(9.9e5).translation, [0.0, 0.0, 9.9e5], rtol=1e-6)
    assert refused(lambda: at(1.01e6))


def test_a_camera_is_warned_of_where_nothing_of_the_room_is_in_sight() -> None:
    def warned(low: list[float], high: list[float]) -> bool:
        return bool(list(check_view_of_room([camera()], Room(np.array(low), np.array(high)))))

    # it stands at z = -4, looks along z and sees a fifth of the depth to either side
    assert not warned([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0])
    assert warned([-1.0, -1.0, -7.0], [1.0, 1.0, -4.0])
    assert not warned([0.0, 0.0, -9.0], [0.0, 0.0, -3.0])
    # only the far corner of the room is in sight
    assert not warned([1.19, -3.0, 0.0], [9.0, 0.0, 2.01])
    assert warned([1.21, -3.0, 0.0], [9.0, 0.0, 2.0])


# ── tables


def table(tmp_path: Path, text: str, **how: Any) -> Columns:
    file = tmp_path / "a.csv"
    file.write_bytes(text.encode())
    return read_columns(file, "a.csv", **({"needed": ("a",)} | how))


def test_rows_have_their_lines_and_optional_columns_their_default(tmp_path: Path) -> None:
    found = table(tmp_path, "# note\n\nb, a\n\n1,2\n3,4\n", optional={"b": 0.5, "c": 7.0})
    assert found.lines.tolist() == [5, 6]
    assert found.names == ("b", "a")
    assert len(found) == 2
    assert_array_equal(found.stacked("a", "b", "c"), [[2, 1, 7], [4, 3, 7]])
    assert len(table(tmp_path, "a\n")) == 0
    # one row cannot be read at once: the same numbers, one by one
    assert_array_equal(table(tmp_path, 'b,a\n"1",2\n3, 4 \n').values["a"], [2, 4])
    blank = table(tmp_path, "a,b\n1,\n,2\n", blank=("a", "b"))
    assert_array_equal(blank.stacked("a", "b"), [[1, np.nan], [np.nan, 2]])


def test_a_table_has_a_largest_number_and_a_largest_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert table(tmp_path, "a\n1000000\n-1e6\n").values["a"].tolist() == [1e6, -1e6]
    assert table(tmp_path, "a\n10\n", largest=10.0).values["a"].tolist() == [10.0]
    one_by_one = table(tmp_path, "a,b\n10,\n", blank=("b",), largest=10.0)
    assert one_by_one.values["a"].tolist() == [10.0]
    assert refused(lambda: table(tmp_path, "a\n10.5\n", largest=10.0))
    for name, fits, more in (
        ("MOST_ROWS", "a\n1\n2\n3\n", "a\n1\n2\n3\n4\n"),
        ("MOST_COLUMNS", "a,b,c\n", "a,b,c,d\n"),
        ("MOST_BYTES", "a\n\n", "a\n1\n"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(csv_columns, name, 3)
            table(tmp_path, fits)
            with pytest.raises(SequenceError, match=r"expected (a table of )?at most"):
                table(tmp_path, more)


def columns(**values: list[float]) -> Columns:
    count = len(next(iter(values.values())))
    arrays = {name: np.array(one, dtype=float) for name, one in values.items()}
    return Columns("a.csv", tuple(values), arrays, 2 + np.arange(count))


def test_a_column_of_whole_numbers_has_bounds() -> None:
    whole = columns(a=[1, 3, 2.0**53])
    assert whole.whole("a", 1, None, "it").tolist() == [1, 3, 2**53]
    for values, first in (([1, 0, 9], 3), ([4, 3.5, 9], 3), ([3, 9, 4.1], 4), ([2.0**54], 2)):
        last = None if values == [2.0**54] else 9
        with pytest.raises(SequenceError, match=f'line {first}, column "a": expected a whole'):
            columns(a=values).whole("a", 1, last, "it")
    assert refused(lambda: columns(a=[10]).whole("a", 1, 9, "it"))


def test_rows_are_ordered_by_step_and_id_of_which_each_is_there_once() -> None:
    rows = columns(id=[2, 1, 1, 2])
    frames, ids = np.array([1, 1, 0, 0]), np.array([2, 1, 1, 2])
    assert rows.one_row_each(frames, ids, "person").tolist() == [2, 3, 1, 0]
    with pytest.raises(SequenceError) as reported:
        rows.one_row_each(np.array([1, 0, 2, 1]), ids, "person")
    assert "line 5" in str(reported.value)
    assert "person 2 is at step 1 already in line 2; expected one row a person" in str(
        reported.value
    )


def test_no_spreadsheet_takes_a_name_for_a_formula_and_names_come_back() -> None:
    for text, cell in (
        ("=1", "'=1"), ("a", "a"), ("a, +b", "a, '+b"), ("a;@b", "a;'@b"), ("'=1", "''=1"),
        ("it's", "it's"), ("a-b", "a-b"), ("-", "'-"), ("'a", "'a"),
    ):  # fmt: skip
        assert guarded(text) == cell
        assert unguarded(cell) == text


# ── boxes and truth


def box_table(rows: list[tuple[float, ...]], **how: Any) -> BoxTable:
    cells = np.array(rows, dtype=float).reshape(-1, 6)
    names = ("frame", "left", "top", "width", "height", "score")
    values = {name: cells[:, k] for k, name in enumerate(names)}
    made = BoxTable(
        Columns("a.csv", names, values, 2 + np.arange(len(cells))), 0, False, 0, np.zeros((0, 0))
    )
    return replace(made, **how)


def box(frame: float, width: float = 5.0, height: float = 9.0, score: float = 0.5) -> Any:
    return (frame, 1.0, 2.0, width, height, score)


@pytest.mark.parametrize("cell", [3, 4, 5])
def test_a_box_has_a_size_and_a_score(cell: int) -> None:
    limits = ([0.0, 1.0], [-0.01, 1.01]) if cell == 5 else ([1e-4], [0.0, -1.0, 0.9e-4])
    for value in limits[0]:
        row = [*box(0)]
        row[cell] = value
        assert len(box_table([tuple(row)]).detections(2, None)[0].boxes) == 1
    for value in (*limits[1], np.nan):
        row = [*box(0)]
        row[cell] = value
        assert refused(lambda: box_table([tuple(row)]).detections(2, None))  # noqa: B023
    # a row without a box may say what it likes of a score
    nothing = (0.0, np.nan, np.nan, np.nan, np.nan, 7.0)
    assert len(box_table([nothing]).detections(2, None)[0].boxes) == 0


def test_boxes_belong_to_the_step_of_their_frame() -> None:
    looks = np.arange(6.0).reshape(3, 2)
    made = box_table([box(6), box(4), box(5, score=1.0)], first=4, embeddings=looks)
    assert made.steps == 3
    found, looked_at = made.detections(3, None)
    assert looked_at is None
    assert_array_equal(found.frames, [0, 1, 2])
    assert_array_equal(found.scores, [0.5, 1.0, 0.5])
    assert_array_equal(found.embeddings, looks[[1, 2, 0]])
    assert refused(lambda: made.detections(2, None))
    assert box_table([]).steps == 0
    # counted from 4, while the camera's file begins at frame 1: its frames 3, 1 and 2
    clock = Clock(np.array([2, -1, 3]), np.array([-1, -1, 0, 2]))
    found, looked_at = replace(made, file_starts=1).detections(3, clock)
    assert_array_equal(found.frames, [0, 2])
    assert_array_equal(found.scores, [1.0, 0.5])
    assert looked_at is not None
    assert_array_equal(looked_at, [True, False, True])
    found, looked_at = replace(made, file_starts=1, listed=True).detections(3, clock)
    assert looked_at is not None
    assert_array_equal(looked_at, [True, False, True])
    _, looked_at = box_table([box(1)], listed=True).detections(3, None)
    assert looked_at is not None
    assert_array_equal(looked_at, [False, True, False])


def test_frames_that_are_counted_from_1_are_reported_as_such() -> None:
    def sentence(*frames: float, first: int = 0) -> str:
        with pytest.raises(SequenceError) as reported:
            box_table([box(frame) for frame in frames], first=first).detections(3, None)
        return str(reported.value)

    assert 'line 4, column "frame": expected a step from 0 to 2, found 1 to 3' in sentence(1, 2, 3)
    assert "counted from 1" in sentence(3, 1)
    assert "counted from 1" not in sentence(0, 3)
    assert "counted from 1" not in sentence(1, 4)
    assert "counted from 1" not in sentence(2, 3)
    assert "from 1 to 3 (detections_first_frame + the step), found 4" in sentence(1, 4, first=1)


def test_a_step_has_a_thousand_boxes_at_most() -> None:
    rows = [box(0)] * 3 + [box(1)] * 1000
    assert len(box_table(rows).detections(2, None)[0].boxes) == 1003
    with pytest.raises(SequenceError, match=r"line 1005, .*found 1,001 at step 1"):
        box_table([*rows, box(1), box(0)]).detections(2, None)


@pytest.mark.parametrize(
    ("frames", "known"),
    [
        (range(3, 33, 3), range(0, 35, 3)),
        (range(4, 54, 5), range(4, 54, 5)),
        (range(0, 24, 3), None),  # eight steps tell no gap of three: 3 ** 6 : 1
        ([*range(0, 30, 3), 31], None),
    ],
)
def test_a_truth_of_every_third_step_knows_these_alone(
    tmp_path: Path, frames: range | list[int], known: range | None
) -> None:
    file = tmp_path / "truth.csv"
    rows = [f"{frame},1,0,0,0" for frame in frames]
    file.write_text("\n".join(["frame,id,x,y,z", *rows]) + "\n", encoding="utf-8")
    steps = 35 if max(frames) < 35 else 54
    found = truth_of(file, "truth.csv", steps).known
    assert (found is None) == (known is None)
    if known is not None and found is not None:
        assert_array_equal(np.flatnonzero(found), known)


@pytest.mark.parametrize(
    ("ranges", "known"),
    [
        ("# steps = 0-1 3", [1, 1, 0, 1, 0]),
        ("# steps=2-9", [0, 0, 1, 1, 1]),
        ("# other = 1\n\n#steps = 4", [0, 0, 0, 0, 1]),
        ("# note", None),
    ],
)
def test_a_truth_says_of_which_steps_it_knows(
    tmp_path: Path, ranges: str, known: list[int] | None
) -> None:
    file = tmp_path / "truth.csv"
    file.write_text(f"{ranges}\nframe,id,x,y,z,valid\n4,2,1,2,3,0\n4,1,4,5,6,1\n", encoding="utf-8")
    truth = truth_of(file, "truth.csv", 5)
    assert_array_equal(truth.ids, [1, 2])
    assert_array_equal(truth.positions, [[4, 5, 6], [1, 2, 3]])
    assert_array_equal(truth.valid, [True, False])
    assert (truth.known is None) == (known is None)
    if truth.known is not None:
        assert_array_equal(truth.known, np.array(known, dtype=bool))
    assert refused(lambda: truth_of(file, "truth.csv", 4))


@pytest.mark.parametrize("part", ["1-", "a", "-3", "1-b", "0" * 20])
def test_a_range_of_steps_that_is_none_is_refused(tmp_path: Path, part: str) -> None:
    file = tmp_path / "truth.csv"
    file.write_text(f"# steps = 0 {part}\nframe,id,x,y,z\n", encoding="utf-8")
    if part == "1-":  # to itself
        known = truth_of(file, "truth.csv", 3).known
        assert known is not None
        assert_array_equal(known, [True, True, False])
        return
    with pytest.raises(SequenceError, match="line 1: steps: expected ranges like"):
        truth_of(file, "truth.csv", 3)


def test_a_folder_may_have_the_longest_name_and_path() -> None:
    longest = "/".join(["x" * 99] * 40)
    assert len(longest) + 1 == LONGEST_PATH
    for path in ("x" * LONGEST_NAME, f"x{longest}"):
        assert given_folder(path) == Path(path)
        with pytest.raises(SequenceError, match="expected a path of at most"):
            given_folder(f"x{path}")

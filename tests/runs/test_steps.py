"""Steps as long arrays: whatever goes in comes back to the last bit, however it was stored."""

from __future__ import annotations

import pickle
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float, Int
from numpy import ndarray

from tests.engine.synthetic import crossing, sequence, views_at
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.protocol import Associations, FusionResult
from tracker.single_view.protocol import Dropped, ViewEvent, ViewResult, pack_samples
from tracker.steps import ROWS_SECOND, Steps, steps


@pytest.fixture(autouse=True, scope="module")
def _small_blocks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "BLOCK", 4)
        yield


def same(one: Any, other: Any) -> bool:
    """Equal in value, shape and type of number, however deep."""
    if isinstance(one, ndarray):
        return (
            isinstance(other, ndarray)
            and one.dtype == other.dtype
            and one.shape == other.shape
            and one.tobytes() == other.tobytes()
        )
    if isinstance(one, tuple | list | Steps):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[name], other[name]) for name in one)
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(other) and all(
            same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one)
        )
    return type(one) is type(other) and (one == other or one != one)


def random_view(rng: np.random.Generator) -> ViewResult:
    """A result of stage 1 with every field filled, or empty, at random."""
    boxes, estimates, peaks, samples, gates = rng.integers(0, 4, 5)
    kinds = ("new", "vanished", "merged")
    people = rng.integers(0, 3)
    return ViewResult(
        boxes=rng.normal(size=(boxes, 4)),
        weights=rng.random(boxes),
        labels=rng.integers(-1, 9, boxes),
        sigmas=rng.random((boxes, 4)),
        estimates=rng.normal(size=(estimates, 4)),
        estimate_weights=rng.random(estimates),
        estimate_labels=rng.integers(-1, 9, estimates),
        measurements=rng.normal(size=(peaks, 4)),
        measurement_scores=rng.random(peaks),
        samples=pack_samples(rng.normal(size=(samples, 4)), rng.random(samples)),
        information={str(name): float(rng.normal()) for name in rng.integers(0, 5, 3)},
        dropped=Dropped(
            rng.random((gates, 4)).astype(np.float32), rng.integers(0, 3, gates).astype(np.int8)
        ),
        events=tuple(
            ViewEvent(kinds[k], tuple(rng.integers(0, 9, k).tolist()))  # type: ignore[arg-type]
            for k in rng.integers(0, 3, rng.integers(0, 3)).tolist()
        ),
        gates=rng.normal(size=(gates, 5)),
        foreground=rng.integers(0, 255, 9).astype(np.uint8) if rng.random() < 0.5 else None,
        likenesses=rng.random((boxes, people)) if people > 1 else np.zeros((0, 0)),
        blind=bool(rng.random() < 0.3),
    )


def random_fused(rng: np.random.Generator) -> FusionResult:
    """A result of stage 2 of up to three components in two cameras."""
    size, pairs = rng.integers(0, 4, 2)
    return FusionResult(
        GaussianMixture(
            rng.random(size),
            rng.normal(size=(size, 6)),
            rng.normal(size=(size, 6, 6)),
            rng.integers(0, 9, size),
        ),
        rng.random((2, size)),
        rng.integers(-1, 4, (2, size)),
        rng.random((2, size)),
        rng.integers(-1, 4, (2, size)),
        Associations(
            rng.integers(0, 2, pairs).astype(np.int32),
            rng.integers(0, 4, pairs).astype(np.int32),
            rng.integers(0, 4, pairs).astype(np.int32),
            rng.random(pairs).astype(np.float32),
        ),
    )


@dataclass(frozen=True)
class _Inner:
    angles: Float[ndarray, " K"]
    name: str


@dataclass(frozen=True)
class _Outer:
    grid: Int[ndarray, "R 2 3"]
    maybe: Float[ndarray, " M"] | None = None
    inner: _Inner | None = None
    words: tuple[str, ...] = ()
    number: float = 0.0
    across: Int[ndarray, "2 J"] = field(
        default_factory=lambda: np.zeros((2, 0), np.int16), metadata=ROWS_SECOND
    )


def random_outer(rng: np.random.Generator) -> _Outer:
    """A value with fields of every other kind, among them arrays of several types of number."""
    kinds = (np.int64, np.int32, ">i4", np.uint8)
    numbers = (0.0, -0.0, float("nan"), float("-inf"), 5e-324, 0.1)
    return _Outer(
        rng.integers(0, 99, (rng.integers(0, 3), 2, 3)).astype(kinds[rng.integers(4)]),
        None if rng.random() < 0.4 else rng.random(rng.integers(0, 3)),
        None
        if rng.random() < 0.4
        else _Inner(rng.random(rng.integers(0, 3)), "aü"[: rng.integers(3)]),
        ("", "z", "ß")[: rng.integers(4)],
        numbers[rng.integers(6)],
        rng.integers(0, 9, (2, rng.integers(0, 3))).astype(np.int16),
    )  # fmt: skip


KINDS = {
    "views": (ViewResult, 2, lambda rng: (random_view(rng), random_view(rng))),
    "fused": (FusionResult, None, random_fused),
    "other": (_Outer, None, random_outer),
}
"""The dataclass, the number of parts, and a random value of some kinds."""

WAYS = st.lists(
    st.sampled_from(["append"] * 6 + ["shared", "written", "pickled", "cut", "alike"]), max_size=30
)
"""What happens to a column, in turn."""


def through_files(column: Steps[Any], kind: type, width: int | None) -> Steps[Any]:
    """Write a column, and map it again."""
    # the folder goes while its files are mapped
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        column.write(Path(place), "key")
        return Steps.read(Path(place), kind, frames=len(column), width=width, key="key")


@given(st.sampled_from(list(KINDS)), WAYS, st.integers(0, 2**32 - 1))
def test_values_come_back_to_the_bit_however_they_were_stored(
    name: str, ways: list[str], seed: int
) -> None:
    kind, width, make = KINDS[name]
    rng = np.random.default_rng(seed)
    column: Steps[Any] = Steps(kind, width)
    values: list[Any] = []
    earlier: list[tuple[Steps[Any], list[Any]]] = []
    for way in ways:
        if way == "append":
            values.append(make(rng))
            column.append(values[-1])
        elif way == "shared":
            earlier.append((column, list(values)))
            column = column.shared()
        elif way == "written":
            column = through_files(column, kind, width)
        elif way == "pickled":
            column = pickle.loads(pickle.dumps(column))
        elif way == "cut":
            values = values[: rng.integers(len(values) + 1)]
            column = column.before(len(values))
        else:
            column = column.alike(reversed(column))
            values.reverse()
    # whoever went on from a copy did not change the column that it was of
    for found, wanted in [*earlier, (column, values)]:
        assert len(found) == len(wanted)
        assert same(list(found), wanted)
        for k in rng.permutation(len(wanted)).tolist():
            assert same(found[k], wanted[k])
            assert same(found[k - len(wanted)], wanted[k])
        with pytest.raises(IndexError):
            found[len(wanted)]
        first, last = sorted(rng.integers(-2, len(wanted) + 3, 2).tolist())
        for chosen in (slice(first, last), slice(None, None, -1), slice(0, last)):
            assert same(found[chosen], wanted[chosen])
        assert same(list(found.before(last)), wanted[: max(last, 0)])


@given(st.integers(0, 20), st.booleans(), st.integers(0, 2**32 - 1))
def test_a_column_is_the_rows_of_all_steps(count: int, written: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    views = [(random_view(rng), random_view(rng)) for _ in range(count)]
    fused = [random_fused(rng) for _ in range(count)]
    seen, result = Steps.of(views, ViewResult, 2), Steps.of(fused, FusionResult)
    if written:
        seen, result = through_files(seen, ViewResult, 2), through_files(result, FusionResult, None)
    first, last = sorted(rng.integers(0, count + 1, 2).tolist())
    for part in (0, 1):
        boxes = seen.column("boxes", part, first=first, last=last)
        wanted = [step[part].boxes for step in views[first:last]]
        assert len(boxes) == len(wanted)
        assert same([boxes[k] for k in range(len(boxes))], wanted)
        assert boxes.steps.tolist() == np.repeat(np.arange(len(wanted)), boxes.counts).tolist()
        blind = seen.values("blind", part, first=first, last=last)
        assert list(blind) == [step[part].blind for step in views[first:last]]
        gates = seen.column("dropped.gates", part)
        assert same([gates[k] for k in range(count)], [step[part].dropped.gates for step in views])
    sources = result.column("sources", first=first, last=last)
    assert same(
        [sources[k].T for k in range(last - first)], [one.sources for one in fused[first:last]]
    )
    only = seen.parts([1])
    assert same(list(only), [(step[1],) for step in views])


@pytest.mark.parametrize(("block", "written"), [(256, False), (256, True), (2, False)])
def test_numbers_of_mappings_are_columns_of_their_names(
    monkeypatch: pytest.MonkeyPatch, block: int, written: bool
) -> None:
    monkeypatch.setattr(steps, "BLOCK", block)
    rng = np.random.default_rng(1)
    told: list[dict[str, float]] = [{"a": 1.0}, {}, {"a": 2.0, "b": 3.0}, {"b": 4.0}, {"b": 5}]
    views = [(replace(random_view(rng), information=one),) for one in told]
    seen: Steps[Any] = Steps(ViewResult, 1)
    for view in views[:3]:
        seen.append(view)
    assert seen.numbers("information")["a"].tolist()[2:] == [2.0]  # and columns grow afterwards
    for view in views[3:]:
        seen.append(view)
    if written:
        seen = through_files(seen, ViewResult, 1)
    found = seen.numbers("information")
    for name in ("a", "b"):
        np.testing.assert_array_equal(found[name], [one.get(name, np.nan) for one in told])
    assert len(found) == 2


def test_a_column_of_several_shapes_or_types_is_refused() -> None:
    column = Steps.of([_Outer(np.ones((1, 2, 3))), _Outer(np.ones((1, 2, 3), np.int8))], _Outer)
    with pytest.raises(ValueError, match="grid: arrays of one column must agree"):
        column.column("grid")
    assert [one.grid.dtype.name for one in column] == ["float64", "int8"]


def test_steps_of_a_real_stage_take_little_more_than_their_numbers() -> None:
    whole = sequence(crossing(40), 40, clutter_rate=1.0)
    views = [tuple(views_at(whole, frame)) for frame in range(40)]
    column = Steps.of(views, ViewResult, 3)
    assert same(list(column), views)
    numbers = sum(
        array.nbytes
        for step in views
        for view in step
        for array in (view.boxes, view.weights, view.labels, view.sigmas)
    )  # the others are the same arrays, or empty; and the labels of all cameras are equal
    assert 0.8 * numbers <= column.nbytes < 1.2 * numbers
    assert Steps(ViewResult, 3).nbytes == 0


def test_values_that_are_no_such_dataclass_are_stored_as_they_are() -> None:
    odd = [None, _Inner(np.ones(2), "a"), 3, _Outer(np.zeros((0, 2, 3))), [1], None]
    column = Steps.of(odd, _Outer)
    assert same(list(column), odd)
    with tempfile.TemporaryDirectory() as place, pytest.raises(TypeError):
        column.write(Path(place))


def test_what_is_read_can_be_written_to_without_effect_on_the_files(tmp_path: Path) -> None:
    column = Steps.of([_Outer(np.ones((1, 2, 3), int)) for _ in range(9)], _Outer)
    column.write(tmp_path)
    found = Steps.read(tmp_path, _Outer, frames=9)
    found[5].grid[:] = 7
    assert same(list(Steps.read(tmp_path, _Outer, frames=9)), list(column))


def test_a_folder_that_was_cut_short_changed_or_is_of_something_else_is_refused(
    tmp_path: Path,
) -> None:
    rng = np.random.default_rng(0)
    Steps.of([random_outer(rng) for _ in range(11)], _Outer).write(tmp_path, "key")
    wanted = {"kind": _Outer, "frames": 11, "key": "key"}
    assert len(Steps.read(tmp_path, **wanted)) == 11
    for other in (
        {"frames": 10}, {"key": ""}, {"width": 1}, {"kind": ViewResult}, {"kind": FusionResult},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"expected|not columns"):
            Steps.read(tmp_path, **{**wanted, **other})
    for path in sorted(tmp_path.iterdir()):
        whole = path.read_bytes()
        spoilt = [whole[:cut] for cut in {0, 1, len(whole) // 2, len(whole) - 1}]
        for place in rng.integers(0, len(whole), 12).tolist():
            spoilt.append(whole[:place] + bytes([whole[place] ^ 0x11]) + whole[place + 1 :])
        for data in [*spoilt, whole + b" "]:
            path.write_bytes(data)
            with pytest.raises(ValueError, match=r"not what was written|utf-8"):
                Steps.read(tmp_path, **wanted)
        path.unlink()
        with pytest.raises(OSError, match="No such file"):
            Steps.read(tmp_path, **wanted)
        path.write_bytes(whole)
    assert len(Steps.read(tmp_path, **wanted)) == 11


def test_one_thread_appends_while_others_read() -> None:
    rng = np.random.default_rng(0)
    values = [random_outer(rng) for _ in range(400)]
    column: Steps[_Outer] = Steps(_Outer)
    wrong: list[str] = []
    begun = threading.Barrier(4)

    def read(seed: int) -> None:
        own = np.random.default_rng(seed)
        begun.wait()
        while (count := len(column)) < len(values):
            if count:
                k = int(own.integers(count))
                if not same(column[k], values[k]) or len(column.before(count)) != count:
                    wrong.append(f"step {k} of {count}")
                grids = [column.column("inner.angles", last=count)[k]]
                inner = values[k].inner
                if not same(grids, [np.zeros(0) if inner is None else inner.angles]):
                    wrong.append(f"angles of {k} of {count}")

    threads = [threading.Thread(target=read, args=(seed,)) for seed in range(3)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        begun.wait()
        for value in values:
            column.append(value)
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert not wrong
    assert same(list(column), values)

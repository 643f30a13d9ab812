"""Columns as arrays and back: to the last bit, for whatever a step's result is made of."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float, Int
from numpy import ndarray

from tests.engine.synthetic import crossing, sequence, views_at
from tracker.runs.stage_files import pack, unpack
from tracker.single_view.protocol import ViewEvent, ViewResult


def same(one: Any, other: Any) -> bool:
    """Equal in value, shape and type of number, however deep."""
    if isinstance(one, ndarray):
        return (
            isinstance(other, ndarray)
            and one.dtype == other.dtype
            and one.shape == other.shape
            and one.tobytes() == other.tobytes()
        )
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return type(one) is type(other) and (one == other or one != one)


def random_result(rng: np.random.Generator) -> ViewResult:
    """A result with every field filled, or empty, at random."""
    boxes, estimates, peaks, samples, gates = rng.integers(0, 4, 5)
    kinds = ("new", "vanished", "merged")
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
        samples=rng.normal(size=(samples, 4)).astype(np.float32),
        sample_weights=rng.random(samples).astype(np.float32),
        information={str(name): float(rng.normal()) for name in rng.integers(0, 5, 3)},
        events=tuple(
            ViewEvent(kinds[k], tuple(rng.integers(0, 9, k).tolist()))  # type: ignore[arg-type]
            for k in rng.integers(0, 3, rng.integers(0, 3)).tolist()
        ),
        gates=rng.normal(size=(gates, 5)),
    )


@given(st.integers(0, 12), st.integers(0, 2**32 - 1))
def test_results_come_back_as_they_were(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    results = [random_result(rng) for _ in range(count)]
    packed = pack(results, ViewResult)
    assert all(array.dtype != object for array in packed.values())
    found = unpack(packed, ViewResult)
    assert len(found) == count
    for one, other in zip(results, found, strict=True):
        for each in fields(ViewResult):
            mine, its = getattr(one, each.name), getattr(other, each.name)
            if isinstance(mine, ndarray) and not len(mine):
                assert len(its) == 0  # of nothing but empty arrays only the number is kept
            else:
                assert same(mine, its), each.name


def test_results_of_a_real_stage_come_back_as_they_were() -> None:
    whole = sequence(crossing(20), 20, clutter_rate=1.0)
    results = [view for frame in range(20) for view in views_at(whole, frame)]
    assert all(map(same, results, unpack(pack(results, ViewResult), ViewResult)))


def test_numbers_that_are_none_come_back() -> None:
    odd = {"nan": float("nan"), "inf": float("inf"), "tiny": 5e-324, "numpy": np.float32(0.1)}
    result = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
    result.information.update(odd)
    (found,) = unpack(pack([result], ViewResult), ViewResult)
    assert found.information.keys() == odd.keys()
    for name, value in odd.items():
        assert same(found.information[name], float(value))


@dataclass(frozen=True)
class _Inner:
    angles: Float[ndarray, " K"]
    name: str


@dataclass(frozen=True)
class _Outer:
    grid: Int[ndarray, "R 2 3"]
    maybe: Float[ndarray, " M"] | None = None
    inner: _Inner | None = None
    words: tuple[str, ...] = field(default=())


def test_new_kinds_of_field_need_nothing() -> None:
    items = [
        _Outer(np.arange(12).reshape(2, 2, 3), np.array([1.5]), _Inner(np.zeros(3), "a"), ("x",)),
        _Outer(np.zeros((0, 2, 3), dtype=np.int64)),
        _Outer(np.ones((1, 2, 3), dtype=np.int64), np.zeros(0), _Inner(np.ones(1), "ü"), ("", "z")),
    ]
    found = unpack(pack(items, _Outer), _Outer)
    assert found[1].maybe is None
    assert found[1].inner is None
    assert all(map(same, items, found))


def test_what_does_not_fit_is_said() -> None:
    items = [_Outer(np.ones((1, 2, 3), dtype=np.int64), None, None, ("x",))]
    packed = pack(items, _Outer)
    for spoilt, words in (
        ({k: v for k, v in packed.items() if k != "grid"}, "no column grid"),
        ({**packed, "more": np.zeros(1)}, "not columns of _Outer.*more"),
        ({**packed, "grid#": np.array([2])}, "do not add up"),
        ({**packed, "words": np.frombuffer(b"[[1]]", dtype=np.uint8)}, "valid string"),
        ({**packed, "words": np.frombuffer(b"[]", dtype=np.uint8)}, "not columns of _Outer"),
    ):
        with pytest.raises(ValueError, match=words):
            unpack(spoilt, _Outer)
    with pytest.raises(TypeError, match="grid: arrays of one column must agree"):
        pack([items[0], _Outer(np.ones((1, 2, 3), dtype=np.int32))], _Outer)

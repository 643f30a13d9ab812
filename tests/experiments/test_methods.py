"""The experiment on all single-view methods: which are compared, on what, and what is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tracker.experiments import Context
from tracker.experiments.claims import cameras, methods
from tracker.experiments.claims.methods import BOXES_RECORDING, ON_BOXES, ON_PICTURES
from tracker.parameters import METHODS
from tracker.sequences.reader import read_sequence


def test_every_method_is_compared_and_all_are_fused_alike() -> None:
    assert {*ON_PICTURES, ON_BOXES, "none", "onnx_detector"} == set(METHODS["single_view"])
    compared = [methods._parameters(name) for name in (*ON_PICTURES, ON_BOXES)]
    assert [p.single_view for p in compared] == [*ON_PICTURES, ON_BOXES]
    assert {p.fusion_method for p in compared} == {methods.FUSION}
    assert len({p.fusion for p in compared}) == 1


def figures(found: float | None) -> dict[str, Any]:
    return {key: found for key in methods.FIGURES} | {"steps": 9, "steps_per_second": 50.0}


def test_a_method_is_judged_by_its_poorest_scene() -> None:
    measured = {
        "one": {name: figures(0.97) for name in ON_PICTURES},
        "two": {name: figures(0.95) for name in ON_PICTURES},
        "boxes": {ON_BOXES: figures(0.99)},
    }
    found = methods._findings(measured)
    assert [finding.verdict for finding in found] == ["better"] * (len(ON_PICTURES) + 1)
    measured["two"][ON_PICTURES[0]] = figures(0.4)
    measured["one"][ON_PICTURES[1]] = figures(None)
    found = methods._findings(measured)
    assert [finding.verdict for finding in found[:3]][:2] == ["worse", "worse"]
    assert "40.0 % of all positions found in its poorest scene, two" in found[0].found
    assert methods._findings({"boxes": {ON_BOXES: figures(0.99)}})[0].verdict == "better"


def test_recordings_that_are_not_there_are_left_out_with_a_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(methods.sequences, "ROOMS", ())
    notes: list[str] = []
    assert methods._scenes(Context(data=tmp_path), notes) == []
    assert len(notes) == 2
    assert all(note.startswith("Left out: the real recording") for note in notes)


def test_boxes_are_fused_by_the_method_that_needs_them(data_folder: Path) -> None:
    sequence = read_sequence(data_folder / BOXES_RECORDING)
    assert sequence.has_detections
    assert not sequence.has_pictures
    found = methods._measure(Context(), sequence, ON_BOXES, 60)
    assert found["steps"] == 60
    assert found["mota"] > 0.9
    assert not read_sequence(data_folder / cameras.RECORDING).has_detections

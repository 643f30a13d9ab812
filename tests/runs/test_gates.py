"""A run tells what its cameras looked at, where it fell, and what was not believed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.engine.painted import GREEN, RED, painted_sequence
from tests.engine.synthetic import walk
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.gates import _NO_CANDIDATES, _SLIDERS, count_gates, decisive_gate, notices
from tracker.runs.outcome import why_no_tracks
from tracker.runs.run import Run
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.protocol import CANDIDATES, DROPPED, GATES, TRUST, UNCERTAINTY, ViewResult

STEPS = 10


def film(folder: Path, *, stays: bool, narrow: bool = False) -> Sequence:
    """Somebody who stays or walks, twice as wide as a target where that is narrow."""
    seat = np.tile([0.35, -0.3, 1.0], (STEPS, 1))
    path = seat if stays else walk((-0.8, 0.0, 1.0), (0.6, 0.3, 1.05), STEPS)
    sequence = painted_sequence(folder, [path], [RED if stays else GREEN])
    shares = [0.5, 0.5, 1.0] if narrow else np.ones(3)
    return replace(sequence, target_half_extents=sequence.target_half_extents * shares)


def run_of(sequence: Sequence, **changes: object) -> Run:
    keys = {name.replace("__", "."): value for name, value in changes.items()}
    return pipeline.compute(sequence, with_values(RunParameters(), keys))


def test_candidates_are_passed_on_or_fall_at_a_gate(tmp_path: Path) -> None:
    (told,) = count_gates(run_of(film(tmp_path, stays=False)))
    assert told.pictures == STEPS
    assert told.passed > 0.8
    assert told.candidates == pytest.approx(told.passed + sum(told.dropped.values()))
    assert f"{told.passed:.1f} passed on" in str(told)


def test_a_gate_that_lets_nobody_through_is_named(tmp_path: Path) -> None:
    run = run_of(film(tmp_path, stays=False), colour_phd__acceptance_distance=0.05)
    (told,) = count_gates(run)
    assert told.passed == 0.0
    assert told.dropped["colour"] >= 0.9 * told.candidates
    assert any('camera "left"' in one and "for colour" in one for one in notices(run))


def test_what_fell_is_told_with_its_place_and_gate(tmp_path: Path) -> None:
    run = run_of(film(tmp_path, stays=False), colour_phd__acceptance_distance=0.05)
    camera = run.sequence.cameras[0]
    for (view,) in run.views:
        dropped = view.dropped
        assert len(dropped.boxes) == len(dropped.gates) == view.information["candidates"]
        told = {name: count for name, count in view.information.items() if name.startswith(DROPPED)}
        named = [DROPPED + GATES[gate] for gate in dropped.gates.tolist()]
        assert told == {name: named.count(name) for name in named}
    # who is refused by the strict gate is the person himself
    last = np.array([[0.6, 0.3, 1.05]])
    (box,), _ = upright_boxes(camera, last, run.sequence.target_half_extents)
    apart = np.abs(run.views[9][0].dropped.boxes[:, :2] - box[:2])
    assert (apart < box[2:]).all(axis=1).any()


def test_a_background_made_by_who_stays_is_told(tmp_path: Path) -> None:
    run = run_of(film(tmp_path, stays=True))
    assert count_gates(run)[0].trust == 0.0
    assert any('background of "left"' in one and "templates" in one for one in notices(run))


def test_a_background_that_somebody_gave_was_not_learnt(tmp_path: Path) -> None:
    """Who names steps as empty at which people are is told so."""
    sequence = film(tmp_path, stays=True)
    views = tuple(replace(view, background=range(STEPS)) for view in sequence.views)
    (told,) = notices(run_of(replace(sequence, views=views, digest="given")))
    assert told.startswith('the background given for "left" shows what the templates show')
    assert "learnt" not in told


def test_of_the_foreground_alone_tops_are_counted(tmp_path: Path) -> None:
    run = run_of(film(tmp_path, stays=False), single_view="jpda", jpda__least_inside=1.0)
    (told,) = count_gates(run)
    assert told.candidates > 0.5
    assert told.dropped["foreground"] > 0.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"single_view": "jpda", "jpda__least_inside": 1.0},
            r"candidates a picture fell for foreground: lower jpda\.least_inside",
        ),
        (
            {
                "single_view": "association_matrix",
                "narrow": True,
                "association_matrix__acceptance": 0.0,
            },
            r"fell for outline: lower association_matrix\.acceptance",
        ),
        (
            {"single_view": "association_matrix", "association_matrix__least_inside": 1.0},
            r"fell for foreground: lower association_matrix\.least_inside",
        ),
        (
            {"stays": True, "single_view": "jpda"},
            r"0\.00 candidates a picture: lower foreground\.threshold",
        ),
        (
            {"colour_phd__acceptance_distance": 0.05},
            r"fell for colour: raise colour_phd\.acceptance_distance",
        ),
    ],
)
def test_a_run_without_tracks_names_gate_and_value(
    changes: dict[str, object], words: str, tmp_path: Path
) -> None:
    stays, narrow = bool(changes.get("stays")), bool(changes.get("narrow"))
    values = {name: value for name, value in changes.items() if name not in ("stays", "narrow")}
    run = run_of(film(tmp_path, stays=stays, narrow=narrow), **values)
    told = why_no_tracks(run)
    assert told is not None
    assert told.startswith("no tracks: 10 pictures")
    assert re.search(words, told), told


def test_a_method_that_holds_its_boxes_back_is_named_and_not_the_room(tmp_path: Path) -> None:
    told = why_no_tracks(
        run_of(film(tmp_path, stays=False), single_view="jpda", jpda__confirmation_steps=STEPS + 1)
    )
    assert told is not None
    assert "0 passed on to the fusion: jpda itself holds them back" in told


def test_where_candidates_pass_no_gate_is_named(tmp_path: Path) -> None:
    assert decisive_gate(run_of(film(tmp_path, stays=False))) is None


def test_what_is_advised_exists() -> None:
    for (method, gate), advice in _SLIDERS.items():
        assert method in METHODS["single_view"]
        assert gate in GATES
        assert all(key in PARAMETERS for key in re.findall(r"\w+\.\w+", advice))
    for method, advice in _NO_CANDIDATES.items():
        assert method in METHODS["single_view"]
        assert all(key in PARAMETERS for key in re.findall(r"\w+\.\w+", advice))


def reported(folder: Path, *informations: dict[str, float]) -> Run:
    """A run whose method reported these counts, one picture after another."""
    run = Run(film(folder, stays=False), RunParameters(), 0, {})
    for information in informations:
        run.views.append((replace(ViewResult.of_no_frame(), blind=False, information=information),))
    return run


@pytest.mark.parametrize(("fell", "named"), [(5.0, True), (4.9, False)])
def test_a_gate_is_named_from_half_of_the_candidates_on(
    fell: float, named: bool, tmp_path: Path
) -> None:
    told = decisive_gate(reported(tmp_path, {CANDIDATES: 10.0, f"{DROPPED}colour": fell}))
    assert told == ("5.0 of 10.0 candidates a picture fell for colour: " + _SLIDERS[
        "colour_phd", "colour"
    ] if named else None)  # fmt: skip


@pytest.mark.parametrize(("pictures", "rare"), [(20, False), (21, True)])
def test_with_less_than_a_candidate_in_twenty_pictures_no_gate_matters(
    pictures: int, rare: bool, tmp_path: Path
) -> None:
    without = [{CANDIDATES: 0.0}] * (pictures - 1)
    run = reported(tmp_path, {CANDIDATES: 1.0, f"{DROPPED}colour": 1.0}, *without)
    told = decisive_gate(run)
    assert told is not None
    assert told.endswith(_NO_CANDIDATES["colour_phd"]) == rare


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        (TRUST, 0.49, "for their templates lie on it"),
        (TRUST, 0.5, ""),
        (UNCERTAINTY, 0.51, "for much that moves never leaves"),
        (UNCERTAINTY, 0.5, ""),
    ],
)
def test_a_background_is_mistrusted_beyond_one_half(
    name: str, value: float, words: str, tmp_path: Path
) -> None:
    told = notices(reported(tmp_path, {CANDIDATES: 1.0, name: value}))
    assert any("background" in one for one in told) == bool(words)
    assert any(words in one for one in told)

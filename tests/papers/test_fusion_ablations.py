"""The study of the parameters of fusion and smoothing: what is judged, where, and what is flat."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.papers.rooms import constants, fusion_ablations
from tests.papers.rooms.ablations import LEAST
from tests.papers.rooms.fusion_ablations import (
    FIGURES,
    FILTERS,
    RANGES,
    Scenes,
    effects,
    fill,
    groups_of,
    is_flat,
    judged,
    table,
    trials,
    values_of,
)
from tests.papers.rooms.kept import Rows, read_rows
from tests.random_rooms import random_room
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values
from tracker.smoothing.tracklets import costs, splitting

ROOMS = ["1", "2"]
GROUPS = groups_of(ROOMS)


def test_each_parameter_is_judged_at_other_values_within_its_range() -> None:
    keys = judged()
    assert RANGES.keys() <= set(keys)
    for key in keys:
        assert PARAMETERS[key].published is None
        assert not PARAMETERS[key].essential
        default = value_of(RunParameters(), key)
        assert values_of(key), key
        for value in values_of(key):
            assert value != default, key
            with_values(RunParameters(), {key: value})  # is accepted
        if key in RANGES:
            assert min(values_of(key)) < default < max(values_of(key)), key
    every = [one for key in keys for fusion in FILTERS for one in trials(key, fusion)]
    assert len({one.row_key(100) for one in every}) == len(every)


def rows_with(change: float, key: str) -> Rows:
    """Rows in which the first value of a parameter changes IDF1 by so much in one of two rooms."""
    found: Rows = {}
    for number, room in enumerate(ROOMS):
        for trial in trials(key, FILTERS[0]) + trials(key, FILTERS[1]):
            for one in (trial.usual, trial):
                figures = dict.fromkeys(FIGURES, 0.5)
                if one == trials(key, FILTERS[0])[0] and number == 0:
                    figures["idf1"] += change
                found[room, one.row_key(100)] = figures
    return found


@pytest.mark.parametrize(("change", "flat"), [(1.9 * LEAST, True), (-2.1 * LEAST, False)])
def test_flat_is_what_changes_no_mean(change: float, flat: bool) -> None:
    key = "fusion.duplicate_distance"
    rows = rows_with(change, key)
    assert is_flat(effects(rows, key, GROUPS, 100)) == flat
    assert not is_flat(effects({}, key, GROUPS, 100)), "what was not measured is not flat"
    text = table(rows, [key], {key: ROOMS}, 100)
    (line,) = [one for one in text.splitlines() if one.startswith(f"| {key} | 0.25 | 2 |")]
    assert f"+0.000 +0.000 {change / 2.0:+.3f} / +0.000 +0.000 +0.000" in line
    assert line.endswith("| flat |" if flat else "|  |")


def test_what_was_run_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def measure(_scenes: Scenes, name: str, trial: object) -> dict[str, float]:
        asked.append((name, trial))
        return dict.fromkeys(FIGURES, 0.25)

    monkeypatch.setattr(fusion_ablations.Scenes, "measure", measure)
    key = "smoothing.jump"
    fill(read_rows(tmp_path), ["7"], [key], 20, tmp_path)
    assert [trial for _, trial in asked] == [
        trials(key, FILTERS[0])[0].usual,
        *trials(key, FILTERS[0]),
    ]
    fill(read_rows(tmp_path), ["7"], [key], 20, tmp_path)
    assert len(asked) == 3


def test_a_constant_is_changed_wherever_it_was_imported_and_is_itself_again() -> None:
    usual = costs.FASTEST
    with constants.set_to("tracker.smoothing.tracklets.costs.FASTEST", 7.0):
        assert (costs.FASTEST, splitting.FASTEST) == (7.0, 7.0)
    assert (costs.FASTEST, splitting.FASTEST) == (usual, usual)


def test_what_a_constant_changes_is_printed_for_each_value(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    room = random_room(0, cameras=3, people=2, fps=4.0, steps=30)
    monkeypatch.setattr(constants, "scenes", lambda: {"crowd 0": (room, 30)})
    assert constants.main(["tracker.smoothing.smoother.START_SIGMA", "10.0", "0.01"]) == 0
    same, moved = capsys.readouterr().out.splitlines()
    assert same.startswith("10.0 in crowds: recall +0.0000 (at most 0.0000), ")
    assert "millimetres +0.0000 (" in same
    assert "millimetres +0.0000 (" not in moved

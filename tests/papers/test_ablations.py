"""The study of stage 1's parameters: what is judged, at which values, and what counts as flat."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.papers.rooms import ablations
from tests.papers.rooms.ablations import METHODS, Trial, effects, ends, judged, table, trials
from tests.papers.rooms.kept import keep_row, read_rows
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values


@pytest.mark.parametrize("method", METHODS)
def test_published_and_essential_numbers_are_not_judged(method: str) -> None:
    keys = judged(method)
    assert len(keys) > 3
    for key in keys:
        parameter = PARAMETERS[key]
        assert parameter.stage == "single_view"
        if parameter.kind in ("int", "float"):
            assert parameter.published is None
            assert not parameter.essential
    if method == "colour_phd":
        assert "colour_phd.carry_templates" in keys, "a mechanism beyond the paper"
        assert "colour_phd.acceptance_distance" not in keys


def test_ends_are_other_values_within_the_range_on_both_sides() -> None:
    one_sided = 0
    for key in {key for method in METHODS for key in judged(method)}:
        default, values = value_of(RunParameters(), key), ends(key)
        assert values, key
        for value in values:
            assert value != default
            with_values(RunParameters(), {key: value})  # is accepted
        if PARAMETERS[key].kind in ("int", "float"):
            one_sided += min(values) > default or max(values) < default
    assert one_sided <= 2, "a default at the end of its range has one side"


def test_every_trial_has_a_key_of_its_own() -> None:
    made = list(trials(tuple(METHODS)))
    assert len({one.row_key(100) for one in made}) == len(made)
    assert made[0].row_key(100) != made[0].row_key(50)


def measured(folder: Path, seed: int, trial: Trial, recall: float) -> None:
    row: dict[str, Any] = {"seed": seed, "key": trial.row_key(9), "false_per_step": 0, "idf1": 1}
    keep_row(folder, row | {"found_share": recall})


def test_a_parameter_acts_where_a_value_changes_the_mean_of_a_figure(tmp_path: Path) -> None:
    first, second = judged("jpda")[:2]
    for seed in (1, 2):
        for trial in trials(("jpda",)):
            if trial.key in ("", first, second):
                # that of the first is of one room: by chance a track comes or goes there
                by = 0.1 if seed == 1 else 0.0
                moved = {first: by, second: 0.006, "": 0.0}[trial.key]
                measured(tmp_path, seed, trial, 0.5 + moved)
    seeds = (1, 2)
    found = {one["parameter"]: one for one in effects(read_rows(tmp_path), seeds, 9, ("jpda",))}
    assert [found[key]["flat"] for key in (first, second)] == [True, False]
    assert [found[key]["acts"] for key in (first, second)] == [False, True]
    assert found[second]["rooms"] == seeds
    assert next(iter(found[second]["changes"].values()))[0] == pytest.approx(0.006)
    assert next(iter(found[first]["changes"].values()))[0] == pytest.approx(0.05)
    other = found[judged("jpda")[2]]
    assert not other["flat"], "what was not measured is not flat"
    assert not other["acts"]
    earlier = (
        f"| jpda | jpda.gone | 2 | 7 8 | +0.000 | +0.000 | +0.000 | flat |\n| jpda | {first} | 9 "
    )
    earlier += "| 1 2 | +0.000 | +0.000 | +0.000 | same |\n"
    text = table(list(found.values()), 9, earlier)
    assert "| jpda.gone | 2 | 7 8 |" in text
    assert "| 9 | 1 2 |" not in text, "measured anew"
    assert text.count("| flat |") == len(ends(first)) + 1
    assert text.count("| acts |") == len(ends(second))
    assert f"| {second} " in text


def test_what_acts_in_the_first_rooms_is_not_run_in_further(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, acting = [], judged("none")[0]

    def fill(rows: Any, seed: int, steps: int, missing: list[Trial], folder: Path) -> None:
        run.append((seed, {trial.key for trial in missing}))
        for trial in missing:
            measured(folder, seed, trial, 0.5 + 0.2 * (trial.key == acting))
        rows |= read_rows(folder)

    monkeypatch.setattr(ablations, "_fill_room", fill)
    monkeypatch.setattr(ablations, "ROOMS_FOR_ALL", 2)
    ablations.fill({}, (4, 5, 6), 9, ("none",), tmp_path)
    everything = {"", *judged("none")}
    assert run == [(4, everything), (5, everything), (6, everything - {acting})]


def test_what_has_a_row_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for trial in trials(("jpda",)):
        row = {"found_share": 0.5, "false_per_step": 0.0, "idf1": 0.5}
        keep_row(tmp_path, row | {"seed": 7, "key": trial.row_key(9)})

    def fails(*_: object, **__: object) -> None:
        raise AssertionError("rendered")

    monkeypatch.setattr(ablations, "render_random", fails)
    shown = tmp_path / "table.md"
    words = ["-o", tmp_path, "--table", shown, "--seeds", 7, "--steps", 9]
    assert ablations.main([*map(str, words), "--method", "jpda"]) == 0
    assert "flat" in shown.read_text(encoding="utf-8")
    with pytest.raises(AssertionError, match="rendered"):
        ablations.main([*map(str, words), "--method", "shapes"])
    assert Trial("shapes").row_key(9) not in {key for _, key in read_rows(tmp_path)}

"""What the experiments make of their numbers, and the files that they leave."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracker.experiments import EXPERIMENTS, Experiment, Result
from tracker.experiments.claims import cameras, fig1, fig3
from tracker.experiments.laboratory import sequences
from tracker.experiments.laboratory.writing import write

NONE = float("nan")


def verdicts(result: Any) -> list[str]:
    return [finding.verdict for finding in result]


def test_every_experiment_says_what_is_claimed() -> None:
    assert {"fig1", "fig2", "fig3", "cameras", "sequences"} <= set(EXPERIMENTS)
    for name, experiment in EXPERIMENTS.items():
        assert experiment.name == name
        assert experiment.claim.endswith(".")
        assert "\n" not in experiment.claim


def test_errors_are_compared_where_they_belong() -> None:
    # one seed, two single cameras, one person, four steps
    scheme = np.array([[[0.1, 0.1, 0.2, NONE]]])
    single = np.array([[[[0.2, 0.4, 0.6, 0.6]], [[0.3, 0.3, NONE, 0.5]]]])
    visible = np.array([[[1.0, 1.0, 0.3, 0.8]], [[1.0, 1.0, 1.0, 0.2]]])
    clear = fig3._compare(scheme, single, fig3._clear(visible))
    assert clear["positions"] == 2
    assert clear["scheme"] == pytest.approx(0.1)
    assert clear["single"] == pytest.approx(0.3)
    assert clear["less"] == pytest.approx(100.0 * 2.0 / 3.0)
    hidden = fig3._compare(scheme, single, fig3._occluded(visible, fig3.CLEAR))
    # camera 1 at steps 2 and 3, camera 2 at step 3
    assert hidden["positions"] == 2
    assert hidden["scheme"] == pytest.approx(0.2)
    assert hidden["single"] == pytest.approx((0.6 + 0.6 + 0.5) / 3.0)
    assert hidden["scheme_found"] == pytest.approx(1.0 / 3.0)
    assert hidden["single_found"] == 1.0
    assert hidden["scheme_all"] == pytest.approx((0.2 + 1.0 + 1.0) / 3.0)
    half = fig3._compare(scheme, single, fig3._occluded(visible, fig3.HALF))
    assert half["single"] == pytest.approx((0.6 + 0.5) / 2.0)


def test_nobody_and_nothing_found_have_defined_answers() -> None:
    nobody = np.full((1, 1, 3), NONE)
    alone = np.full((1, 2, 1, 3), NONE)
    visible = np.full((2, 1, 3), NONE)
    figures = fig3._compare(nobody, alone, fig3._clear(visible))
    assert figures["positions"] == 0
    assert figures["scheme"] is figures["less"] is figures["ratio"] is None
    groups = {name: figures for name in ("a", "b", "c")}
    assert verdicts(fig3._findings(groups)) == ["worse", "worse"]
    over_time = fig3._over_time(nobody, alone)
    assert over_time == [{"person": 1, "scheme": [None] * 3, "single": [None] * 3}]


@pytest.mark.parametrize(
    ("less", "ratio", "expected"),
    [
        (56.0, 1.8, ["better", "better"]),
        (55.6, 2.5, ["better", "better"]),
        (40.0, 1.2, ["worse", "worse"]),
    ],
)
def test_fig3_is_better_from_the_claimed_values_on(
    less: float, ratio: float, expected: list[str]
) -> None:
    figures = {
        "scheme": 0.1, "single": 0.2, "less": less, "ratio": ratio, "scheme_found": 0.9,
        "single_found": 0.8,
    }  # fmt: skip
    found = fig3._findings({name: figures for name in ("clear", "hidden", "half")})
    assert verdicts(found) == expected
    assert f"{ratio:.2f} times" in found[1].found


def test_fig1_is_better_where_everybody_is_followed_and_the_error_small() -> None:
    good = {
        "found_share": 0.95, "armchair_steps": 90, "armchair_tracked_share": 1.0,
        "armchair_error": 0.1,
    }  # fmt: skip
    away = {**good, "armchair_steps": 0, "armchair_tracked_share": None, "armchair_error": None}
    people = {"1": good, "2": good, "3": away}
    assert verdicts(fig1._findings(people, 0.3)) == ["better", "better"]
    lost = {**good, "found_share": 0.5, "armchair_tracked_share": 0.4}
    assert verdicts(fig1._findings({**people, "3": lost}, 0.3)) == ["worse", "worse"]
    far = {**good, "armchair_error": 0.5}
    assert verdicts(fig1._findings({**people, "3": far}, 0.3)) == ["better", "worse"]
    assert verdicts(fig1._findings({}, 0.3)) == ["worse", "worse"]


def test_cameras_is_better_where_each_more_helps() -> None:
    def figures(error: float, ospa: float) -> dict[str, Any]:
        return {"position_error": error, "found_share": 0.9, "ospa": ospa}

    rising = {1: figures(0.5, 0.6), 2: figures(0.2, 0.3), 3: figures(0.1, 0.2)}
    assert verdicts(cameras._findings(rising)) == ["better", "better"]
    flat = {1: figures(0.5, 0.6), 2: figures(0.2, 0.2), 3: figures(0.3, 0.25)}
    assert verdicts(cameras._findings(flat)) == ["worse", "worse"]


def test_sequences_is_as_good_as_its_poorest_scene() -> None:
    good = {"found_share": 0.95, "steps_per_second": 50.0, "fps": 25.0}
    slow = {"found_share": 0.8, "steps_per_second": 20.0, "fps": 25.0}
    assert verdicts(sequences._findings({"a": good})) == ["better", "better"]
    found = sequences._findings({"a": good, "b": slow})
    assert verdicts(found) == ["worse", "worse"]
    assert "b" in found[0].found


@pytest.fixture
def experiment() -> Experiment:
    return Experiment("try", "It works.", lambda context: result())


def result(**more: Any) -> Result:
    return Result(
        head=("name", ">value"), rows=(("a", "1"),), numbers={"a": 1.0}, findings=(), **more
    )


@pytest.mark.full
def test_numbers_and_figure_are_written(experiment: Experiment, tmp_path: Path) -> None:
    def draw() -> Any:
        from tracker.experiments.laboratory import drawing

        figure = drawing.sheet(3.0, 2.0, "title")
        axes = drawing.panels(figure, [["a"]])["a"]
        drawing.bars(axes, ["x", "y"], [0.5, None], [drawing.LINE] * 2, named=True)
        return figure

    files = write(experiment, result(figure=draw), tmp_path / "new", quick=True)
    assert [path.name for path in files] == ["try.json", "try.png"]
    found = json.loads(files[0].read_text(encoding="utf-8"))
    assert (found["experiment"], found["quick"], found["numbers"]) == ("try", True, {"a": 1.0})
    assert found["table"] == {"head": ["name", "value"], "rows": [["a", "1"]]}
    assert files[1].read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["try.json", "try.png"]


def test_a_figure_that_fails_leaves_nothing(experiment: Experiment, tmp_path: Path) -> None:
    def fail() -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(experiment, result(figure=fail), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_number_that_json_has_not_is_refused(experiment: Experiment, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write(experiment, Result(("a",), (), {"a": float("nan")}, ()), tmp_path)


def test_without_matplotlib_the_numbers_are_written(
    experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_figure() -> Any:
        raise AssertionError("nothing can draw it")

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    files = write(experiment, result(figure=no_figure), tmp_path)
    assert [path.name for path in files] == ["try.json"]

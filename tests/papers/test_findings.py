"""What the experiments make of their numbers, and the files that they leave."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.papers.claims import fig3
from tests.papers.laboratory.experiment import Experiment, Result
from tests.papers.laboratory.writing import write

NONE = float("nan")


def test_errors_are_compared_where_they_belong() -> None:
    # one seed, two single cameras, one person, four steps
    scheme = np.array([[[0.1, 0.1, 0.2, NONE]]])
    single = np.array([[[[0.2, 0.4, 0.6, 0.6]], [[0.3, 0.3, NONE, 0.5]]]])
    visible = np.array([[[1.0, 1.0, 0.3, 0.8]], [[1.0, 1.0, 1.0, 0.2]]])
    clear = fig3.compare(scheme, single, fig3.where_clear(visible))
    assert clear["positions"] == 2
    assert clear["scheme"] == pytest.approx(0.1)
    assert clear["single"] == pytest.approx(0.3)
    assert clear["less"] == pytest.approx(100.0 * 2.0 / 3.0)
    hidden = fig3.compare(scheme, single, fig3.where_occluded(visible, fig3.CLEAR))
    # camera 1 at steps 2 and 3, camera 2 at step 3
    assert hidden["positions"] == 2
    assert hidden["scheme"] == pytest.approx(0.2)
    assert hidden["single"] == pytest.approx((0.6 + 0.6 + 0.5) / 3.0)
    assert hidden["scheme_found"] == pytest.approx(1.0 / 3.0)
    assert hidden["single_found"] == 1.0
    assert hidden["scheme_all"] == pytest.approx((0.2 + 1.0 + 1.0) / 3.0)
    half = fig3.compare(scheme, single, fig3.where_occluded(visible, fig3.HALF))
    assert half["single"] == pytest.approx((0.6 + 0.5) / 2.0)


def test_nobody_and_nothing_found_have_defined_answers() -> None:
    nobody = np.full((1, 1, 3), NONE)
    alone = np.full((1, 2, 1, 3), NONE)
    visible = np.full((2, 1, 3), NONE)
    figures = fig3.compare(nobody, alone, fig3.where_clear(visible))
    assert figures["positions"] == 0
    assert figures["scheme"] is figures["less"] is figures["ratio"] is None
    over_time = fig3.over_time(nobody, alone)
    assert over_time == [{"person": 1, "scheme": [None] * 3, "single": [None] * 3}]


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
        from tests.papers.laboratory import drawing

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

"""The experiment on random rooms: resumed, summed up, and told by causes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.papers.laboratory.experiment import Context, RandomRooms, Unavailable
from tests.papers.registry import EXPERIMENTS
from tests.papers.rooms import experiment
from tests.papers.rooms.cases import Case, key_of
from tests.papers.rooms.causes import causes_of, worst_of
from tests.papers.rooms.kept import FILE, keep_row, read_rows

ON_BOXES = ("detection_phd",)


def row(seed: int, found: float, **causes: str) -> dict[str, Any]:
    return {"seed": seed, "found_share": found, "false_per_step": 0.0, "causes": causes}


def test_a_key_depends_on_the_case_and_on_how_much_is_tracked() -> None:
    keys = {key_of(Case(name, t), steps) for name in ("colour_phd", "jpda") for t in (True, False)
            for steps in (None, 10)}  # fmt: skip
    assert len(keys) == 8


def test_the_worst_have_the_cause_in_common() -> None:
    """Twenty rooms; the two worst are the two with a mirror, and lenses say nothing."""
    rows = [
        row(n, 0.1 if n in (3, 11) else 0.9, mirror="yes" if n in (3, 11) else "no",
            lens="mild" if n % 2 else "fisheye")
        for n in range(20)
    ]  # fmt: skip
    assert {r["seed"] for r in worst_of(rows)} == {3, 11}
    first = causes_of(rows)[0]
    assert (first.name, first.value, first.rooms, first.worst) == ("mirror", "yes", 2, 2)
    assert first.found == 0.1
    assert first.elsewhere == 0.9


def test_of_rooms_alike_in_finding_the_one_with_more_false_tracks_is_worse() -> None:
    rows = [row(n, 0.5) | {"false_per_step": n / 10.0} for n in range(4)]
    assert [r["seed"] for r in worst_of(rows)] == [3]


def test_nothing_measured_has_no_causes() -> None:
    assert worst_of([]) == []
    assert causes_of([]) == []


def test_rows_that_were_cut_off_are_measured_again(tmp_path: Path) -> None:
    keep_row(tmp_path / "new", {"seed": 1, "key": "a", "found_share": 0.5})
    with (tmp_path / "new" / FILE).open("a") as file:
        file.write('{"seed": 2, "key"')
    assert list(read_rows(tmp_path / "new")) == [(1, "a")]
    assert read_rows(tmp_path) == {}
    assert read_rows(None) == {}


def test_an_unknown_method_is_told() -> None:
    with pytest.raises(Unavailable, match=r"no single-view method 'yolo'; expected some of"):
        EXPERIMENTS["rooms"].run(Context(rooms=RandomRooms(methods=("yolo",))))


@pytest.mark.full
def test_what_is_kept_is_not_measured_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a detector's boxes; then with a row changed by hand."""
    monkeypatch.setattr(experiment, "QUICK_ROOMS", 1)
    context = Context(output=tmp_path, rooms=RandomRooms(first=71, methods=ON_BOXES), quick=True)
    first = EXPERIMENTS["rooms"].run(context)
    (case,) = first.numbers["cases"].values()
    assert case["rooms"][0]["found_share"] > 0.8
    assert case["worst"] == [71]
    assert not (tmp_path / "rooms").exists()
    kept = json.loads((tmp_path / FILE).read_text())
    kept["found_share"] = 0.123
    (tmp_path / FILE).write_text(json.dumps(kept) + "\n")
    again = EXPERIMENTS["rooms"].run(context)
    assert again.rows[0][2] == "0.123"
    assert {len(line) for line in again.rows} == {len(again.head)}

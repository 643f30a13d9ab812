"""Every experiment in its short form: its files, and the direction of its claims."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import DATA
from tests.papers.claims import association, jpda, ppf
from tests.papers.claims.cmc import GATES
from tests.papers.claims.cmc import methods as cmc_methods
from tests.papers.claims.methods import ON_PICTURES
from tests.papers.claims.uncertainty import NOISIER, QUICK_ROOMS, UNCHANGED
from tests.papers.clips.light import ROBUST
from tests.papers.laboratory.experiment import Context
from tests.papers.laboratory.writing import write
from tests.papers.registry import EXPERIMENTS
from tracker.runs.processes import available_cores

pytestmark = pytest.mark.full

HAS_DATA = DATA.is_dir()
NEEDS_DATA = {"cameras", "cmc", "corrections"}


def verdicts(found: dict[str, Any]) -> list[str]:
    return [finding["verdict"] for finding in found["findings"]]


def fig1(found: dict[str, Any]) -> None:
    for person in found["numbers"]["people"].values():
        assert person["found_share"] > 0.7
        assert person["armchair_error"] < 0.3


def fig2(found: dict[str, Any]) -> None:
    assert found["numbers"]["mean_overlap"] > 0.5


def fig3(found: dict[str, Any]) -> None:
    groups = found["numbers"]["groups"]
    assert groups["without occlusion"]["scheme"] < 0.6 * groups["without occlusion"]["single"]
    assert groups["with occlusion"]["scheme"] < groups["with occlusion"]["single"]


def cameras(found: dict[str, Any]) -> None:
    by_count = found["numbers"]["by_count"]
    assert by_count["3"]["ospa"] < by_count["2"]["ospa"] < by_count["1"]["ospa"]
    assert by_count["3"]["position_error"] < 0.44 * by_count["1"]["position_error"]


def sequences(found: dict[str, Any]) -> None:
    assert found["numbers"]["sequences"]["room44-3p"]["mota"] > 0.7


def cmc(found: dict[str, Any]) -> None:
    recordings = found["numbers"]["recordings"]
    assert all(recording["steps"] == 100 for recording in recordings.values())
    assert len(found["table"]["rows"]) == len(GATES) * len(cmc_methods())


def corrections(found: dict[str, Any]) -> None:
    assert found["numbers"]


def two_in_data_association(found: dict[str, Any]) -> None:
    assert [row[0] for row in found["table"]["rows"]] == list(jpda.methods())
    clips = found["numbers"]["clips"]
    assert clips[jpda.CLASSICAL]["largest"] > 2.0 * clips[jpda.PUBLISHED]["largest"]
    assert clips[jpda.DEFAULTS]["mean"] < 2.0
    assert clips[jpda.DEFAULTS]["largest"] < jpda.LARGEST_ERROR
    middle = found["numbers"]["error_of_the_middle"]
    assert jpda.LARGEST_ERROR < middle <= clips[jpda.PUBLISHED]["largest"]


def pseudo_particles(found: dict[str, Any]) -> None:
    assert len(found["table"]["rows"]) == 9 + 3 * HAS_DATA
    scenes = found["numbers"]["scenes"]
    for name in ("2BALL", "3FACE"):
        assert scenes[name][ppf.CLASSICAL]["every"] < 0.2 < 0.6 < scenes[name][ppf.PSEUDO]["every"]
        assert scenes[name][ppf.ROBUST]["every"] > 0.9
    assert verdicts(found)[:2] == ["better"] * 2


def merging_and_splitting(found: dict[str, Any]) -> None:
    assert verdicts(found) == ["better"] * 4
    passing = found["numbers"]["clips"]["passing"]
    assert passing[association.DEFAULTS]["merged"] < passing[association.PUBLISHED]["merged"] < 6.0
    assert passing[association.ONE_OBJECT]["merged"] > 12.0
    assert found["numbers"]["light"][ROBUST]["f"] > 0.9


def methods(found: dict[str, Any]) -> None:
    measured = found["numbers"]["sequences"]["room44-3p"]
    assert list(measured) == list(ON_PICTURES)
    assert measured["colour_phd"]["found_share"] > 0.8
    assert measured["association_matrix"]["found_share"] > 0.55
    assert len(found["numbers"]["sequences"]) == 1 + 2 * HAS_DATA


def rooms(found: dict[str, Any]) -> None:
    assert all(case["rooms"] for case in found["numbers"]["cases"].values())


def uncertainty(found: dict[str, Any]) -> None:
    walkers = found["numbers"]["walkers"].values()
    assert len(walkers) == QUICK_ROOMS
    assert 0.9 < np.mean([inside for one in walkers for inside in one["inside"]]) < 0.99
    for one in walkers:
        assert one["named"][UNCHANGED] == [None]
        assert one["named"]["turned up or down by 3°"] == [True]
        assert one["named"]["turned sideways by 3°"] == [True]
        assert max(abs(error) for error, _ in one["late"]) < 0.03
        assert max(abs(error) for error, _ in one["heights"]) < 0.02
    assert any(one["named"][NOISIER] == [True] for one in walkers)


LOOKS: dict[str, Callable[[dict[str, Any]], None]] = {
    "fig1": fig1,
    "fig2": fig2,
    "fig3": fig3,
    "cameras": cameras,
    "sequences": sequences,
    "cmc": cmc,
    "corrections": corrections,
    "jpda": two_in_data_association,
    "ppf": pseudo_particles,
    "association": merging_and_splitting,
    "methods": methods,
    "rooms": rooms,
    "uncertainty": uncertainty,
}
"""What must be seen in the numbers of each."""


DEAR = ("fig3", "ppf", "association", "methods", "rooms")
"""Experiments whose short form takes most of a minute each: with ``--long`` alone."""


def look_at(names: Iterable[str], folder: Path) -> None:
    """Run some experiments as the command does, and look at what each leaves.

    As with ``--all`` they share what several of them look at: Figures 1 and 2 are of one run.
    """
    data = DATA if HAS_DATA else None
    context = Context(quick=True, data=data, output=folder, processes=available_cores())
    for name in names:
        if name in NEEDS_DATA and data is None:
            continue
        experiment = EXPERIMENTS[name]
        write(experiment, experiment.run(context), folder, quick=True, seeds=None)
        assert (folder / f"{name}.png").stat().st_size > 10_000, name
        found = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        table = found["table"]
        assert {len(row) for row in table["rows"]} == {len(table["head"])}, name
        LOOKS[name](found)


def test_in_short_they_show_the_direction_of_each_claim(tmp_path: Path) -> None:
    look_at((name for name in EXPERIMENTS if name not in DEAR), tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("name", DEAR)
def test_the_dear_ones_do_too(name: str, tmp_path: Path) -> None:
    look_at([name], tmp_path)

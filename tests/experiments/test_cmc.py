"""The experiment on a person detector's boxes: what it needs, what it finds, what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tracker.experiments import EXPERIMENTS, Context, Unavailable
from tracker.experiments.claims.cmc import BEST_PUBLISHED, GATES, methods


def test_without_the_recordings_it_says_what_is_missing(tmp_path: Path) -> None:
    for data in (None, tmp_path):
        with pytest.raises(Unavailable, match=r"cmc1 is not at hand .* --data DIR"):
            EXPERIMENTS["cmc"].run(Context(data=data))


def test_all_methods_get_the_same_boxes() -> None:
    compared = methods()
    assert {p.single_view for p in compared.values()} == {"none"}
    assert len({p.detection_boxes for p in compared.values()}) == 1
    assert compared["sequential_phd"].fusion == compared["multi_bernoulli"].fusion
    assert compared["sequential_phd as published"].fusion.misses == "per_camera"


@pytest.mark.long
@pytest.mark.data
def test_it_finds_what_it_claims(data_folder: Path) -> None:
    result = EXPERIMENTS["cmc"].run(Context(data=data_folder))
    assert len(result.rows) == len(GATES) * len(methods())
    assert {len(row) for row in result.rows} == {len(result.head)}
    found = json.loads(json.dumps(result.numbers))
    ours = found["recordings"]["cmc2"]["methods"]["multi_bernoulli"]
    assert ours["mota"] >= BEST_PUBLISHED["cmc2"][0]
    assert ours["id_switches"] == 0  # of the filter alone, step by step
    assert ours["steps_per_second"] > 0.0
    # the two scores of the best published filter, and ours against the paper on each recording
    assert len(result.findings) == len(BEST_PUBLISHED) + len(GATES)
    assert [finding.verdict for finding in result.findings][1:] == ["better"] * 4

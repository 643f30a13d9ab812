"""The experiment on a person detector's boxes: what it needs, what it finds, what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.papers.claims.cmc import BEST_PUBLISHED, GATES, methods
from tests.papers.laboratory.experiment import Context, Unavailable
from tests.papers.registry import EXPERIMENTS


def test_without_the_recordings_it_says_what_is_missing(tmp_path: Path) -> None:
    for data in (None, tmp_path):
        with pytest.raises(Unavailable, match=r"cmc1 is not at hand .* --data DIR"):
            EXPERIMENTS["cmc"].run(Context(data=data))


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

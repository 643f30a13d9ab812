"""A study that an earlier version wrote names parameters as they were called then."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from tests.parameters.test_values import MEANT, OTHER
from tests.studies.small import definition
from tracker.files.validated import parse_json
from tracker.parameters.catalogue import RENAMED
from tracker.studies.store import Trial

ENDED = Trial(
    number=3,
    state="complete",
    values=MEANT,
    objectives=(0.5,),
    spreads=(None,),
    figures={"idf1": 0.5},
    vetoed=False,
    words="",
    seconds=1.0,
    jobs=(),
)


def test_its_definition_varies_holds_and_starts_what_it_meant(tmp_path: Path) -> None:
    first, second = RENAMED
    found = definition(tmp_path, parameters={first: {}}, values={second: OTHER[second]})
    assert [one.key for one in found.varied] == [RENAMED[first]]
    assert found.values == {RENAMED[second]: OTHER[second]}
    found = definition(tmp_path, parameters={first: {}}, start={first: OTHER[first]})
    assert found.start == {RENAMED[first]: OTHER[first]}
    nested = {group: {name: {}} for group, name in (key.split(".") for key in RENAMED)}
    found = definition(tmp_path, parameters=nested)
    assert {one.key for one in found.varied} == set(RENAMED.values())


def test_its_trials_have_the_keys_of_now() -> None:
    text = json.dumps(replace(ENDED, values=OTHER).to_json())
    assert parse_json(Trial, text) == ENDED
    assert parse_json(Trial, json.dumps(ENDED.to_json())) == ENDED

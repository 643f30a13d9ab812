"""What differs from the defaults, what a parameter would change, and the runs before."""

from __future__ import annotations

from typing import Any

import pytest
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, command, is_evaluated, run_is, wait_until
from tracker.parameters.catalogue import PARAMETERS

P_D = "fusion.detection_probability"


def get(client: TestClient, path: str) -> Any:
    answer = client.get(f"/api/{path}")
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.mark.full
def test_changes_are_told_with_their_defaults(client: TestClient) -> None:
    assert get(client, "changes")["changed"] == []
    command(client, "set_parameters", changes={P_D: 0.6})
    command(client, "set_parameters", changes={"fusion_method": "sequential_phd"})
    changed = {
        one["key"]: (one["default"], one["now"]) for one in get(client, "changes")["changed"]
    }
    assert changed[P_D] == (PARAMETERS[P_D].default, 0.6)
    assert changed["fusion_method"] == ("multi_bernoulli", "sequential_phd")
    wait_until(run_is(client, "done"))


def test_what_a_parameter_would_change_is_told(client: TestClient) -> None:
    assert get(client, "changes")["curves"] == []
    key = "fusion.extraction_threshold"
    assert client.post("/api/sensitivity", json={"keys": [key]}).status_code == 200
    assert client.post("/api/sensitivity", json={"keys": ["fusion.x"]}).status_code == 422
    wait_until(lambda: get(client, "changes")["curves"] != [])
    (curve,) = get(client, "changes")["curves"]
    assert (curve["key"], curve["measure"]) == (key, "MOTA")
    assert len(curve["values"]) == len(curve["scores"]) > 0
    assert all(-1.0 <= score <= 1.0 for score in curve["scores"])


@pytest.mark.full
def test_an_evaluation_tells_how_much_was_changed_for_it(client: TestClient) -> None:
    assert get(client, "evaluation")["changes"] == 0
    command(client, "set_parameters", changes={P_D: 0.3})
    wait_until(is_evaluated(client))
    assert get(client, "evaluation")["changes"] == 1


@pytest.mark.full
def test_runs_are_listed_and_can_be_taken_up_again(own_client: TestClient) -> None:
    before = get(own_client, "state")
    command(own_client, "set_parameters", changes={P_D: 0.6})
    command(own_client, "set_parameters", changes={"fusion_method": "sequential_phd"})
    wait_until(run_is(own_client, "done"))
    runs = get(own_client, "runs")["runs"]
    numbers = [run["number"] for run in runs]
    assert numbers == sorted(numbers, reverse=True)
    newest, first = runs[0], runs[-1]
    assert newest["key"] == get(own_client, "state")["run"]["key"] != first["key"]
    assert (newest["single_view"], newest["fusion_method"]) == ("none", "sequential_phd")
    assert (newest["changes"], first["changes"]) == (2, 0)
    for run in (newest, first):
        assert (run["state"], run["done"], run["same_recording"]) == ("done", run["total"], True)
    after = command(own_client, "use_again", run=1).json()
    assert after["parameters"] == before["parameters"]
    assert after["methods"] == before["methods"]
    assert command(own_client, "use_again", run=99).status_code == 422
    wait_until(run_is(own_client, "done"))


def test_nothing_open() -> None:
    with TestClient(create_app(Settings(with_viser=False)), base_url=ADDRESS) as client:
        assert client.get("/api/teach").status_code == 409
        assert get(client, "changes") == {"changed": [], "curves": []}
        assert get(client, "runs") == {"runs": []}

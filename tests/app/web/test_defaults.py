"""One default wherever it is told, methods that cannot work here, and hints that lead on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from tests.app.conftest import Runs, command
from tests.app.web.test_api import assert_error
from tracker.evaluation import evaluate_sequence
from tracker.evaluation.report.page import report_html
from tracker.export import tracks_csv
from tracker.parameters.catalogue import DEFAULT_RULE, METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence

DEFINED = RunParameters()


def test_one_default_in_definition_list_help_page_report_and_plain_run(
    client: TestClient, run: Runs, crossing: Path, tmp_path: Path
) -> None:
    sequence = read_sequence(crossing)
    followed = pipeline.default_parameters(sequence)
    assert followed.model_copy(update={"single_view": DEFINED.single_view}) == DEFINED

    state = client.get("/api/state").json()
    assert state["methods"] == {key: value_of(followed, key) for key in METHODS}
    assert state["changed"] == []
    assert state["parameters"] == {key: value_of(DEFINED, key) for key in PARAMETERS}
    schema = client.get("/api/schema").json()
    assert {p["key"]: p["default"] for p in schema["parameters"]} == state["parameters"]

    listed = {row["key"]: row for row in json.loads(run("parameters", "--json")[1])}
    assert DEFINED.fusion_method in listed["fusion_method"]["range"].split("|")
    assert listed["fusion_method"]["default"] == DEFINED.fusion_method
    assert listed["single_view"]["default"] == DEFAULT_RULE

    out = tmp_path / "tracks.csv"
    assert run("track", crossing, "-o", out)[0] == 0
    tracks = tracks_csv.read_tracks_csv(out)
    told = {key: tracks.settings[key] for key in (*METHODS, *PARAMETERS)}
    assert with_values(DEFINED, told) == followed

    text = report_html(sequence, tracks, followed, evaluate_sequence(sequence, tracks))
    assert "all at their defaults" in text
    other = followed.model_copy(update={"fusion_method": "sequential_phd"})
    text = report_html(sequence, tracks, other, evaluate_sequence(sequence, tracks))
    assert "1 changed from the default" in text


def test_the_page_is_told_which_methods_cannot_work_here_and_why(client: TestClient) -> None:
    unfit = client.get("/api/state").json()["unfit"]
    assert unfit["fusion_method"] == {}
    assert set(unfit["single_view"]) >= {
        "colour_phd", "jpda", "pseudo_particle", "association_matrix",
    }  # fmt: skip
    assert set(unfit["single_view"]).isdisjoint({"detection_phd", "none"})
    assert unfit["single_view"]["jpda"].startswith("jpda needs pictures of every camera, and ")
    boxes = {"jpda.measurements": "detections"}
    after = command(client, "set_parameters", changes=boxes).json()
    assert "jpda" not in after["unfit"]["single_view"], "it depends on the values, too"


@pytest.mark.full
@pytest.mark.parametrize(
    ("changes", "asks"),
    [
        ({"single_view": "colour_phd"}, False),
        ({"single_view": "pseudo_particle"}, False),
        ({"single_view": "jpda"}, True),
        ({"single_view": "jpda", "jpda.measurements": "colour"}, False),
        ({"single_view": "association_matrix"}, True),
        ({"single_view": "none"}, True),
    ],
)
def test_teach_says_where_a_method_looks_at_no_templates(
    client: TestClient, changes: dict[str, Any], asks: bool
) -> None:
    command(client, "set_parameters", changes=changes)
    looking = client.get("/api/teach").json()["looking"]
    assert looking == ("colour_phd" if asks else None)


def test_what_was_asked_for_wrongly_is_told_where_to_find_what_there_is(
    client: TestClient,
) -> None:
    def hint(answer: Any) -> str:
        assert_error(answer, 422, "bad_parameter")
        words: str = answer.json()["hint"]
        return words

    wrong = command(client, "set_parameters", changes={"fusion.clutter_rate": -1.0})
    assert hint(wrong) == "The manual lists every parameter with its range."
    preset = command(client, "apply_preset", preset="nobody's")
    assert hint(preset).startswith("The tab Parameters lists the built-in presets ")
    assert hint(command(client, "use_again", run=999)) == "The tab Runs lists them."
    assert "the cameras" in hint(client.post("/api/view", json={"camera": 9}))
    assert "the layers" in hint(client.patch("/api/layers", json={"changes": {"walls": True}}))
    assert "your presets" in hint(command(client, "remove_preset", preset="none-such"))

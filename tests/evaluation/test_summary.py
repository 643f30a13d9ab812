"""The figures as people see them: names, help, JSON and differences."""

from __future__ import annotations

import json
import re

import pytest
from pydantic import ValidationError

from tests.evaluation.scenes import HALF_EXTENTS, by_hand, perturbed, walks
from tracker.evaluation import DEFINITIONS, EvaluationSettings, compare, evaluate
from tracker.evaluation.difference import verdict
from tracker.evaluation.figures import number


def test_every_figure_explains_itself():
    keys = [definition.key for definition in DEFINITIONS]
    assert len(set(keys)) == len(keys)
    for definition in DEFINITIONS:
        assert definition.help.endswith("."), definition.key
        assert re.fullmatch(r"|.*(19|20)\d\d.*", definition.source), definition.key
        assert bool(definition.source) == (definition.group not in ("Positions", "Pictures"))


def test_every_setting_explains_itself():
    for name, schema in EvaluationSettings.model_json_schema()["properties"].items():
        assert schema["description"].endswith("."), name
        assert schema["x-ui"]["symbol"], name
        assert ("minimum" in schema and "maximum" in schema) or "enum" in schema, name
    with pytest.raises(ValidationError, match="greater than or equal to"):
        EvaluationSettings(gate=0.0)
    with pytest.raises(ValidationError, match="Extra inputs"):
        EvaluationSettings(gates=1.0)


def test_settings_stand_beside_the_figures():
    truth, tracks = by_hand()
    settings = EvaluationSettings(gate=0.75, cutoff=2.0, order=2.0, window=1, near=0.2)
    stated = {
        f.definition.key: (f.unit, f.measured_with)
        for f in evaluate(truth, tracks, settings).figures
    }
    assert stated["mota"] == ("", "3D distance, gate 0.75 m")
    assert stated["ospa"] == ("m", "3D distance, cut-off 2 m, order 2")
    assert stated["ospa2"][1] == "3D distance, cut-off 2 m, order 2, window 1 step"
    assert stated["gospa_missed"][0] == "m^2"
    assert stated["found_share"][1] == "within 0.2 m"
    boxes = evaluate(truth, tracks, EvaluationSettings(distance="box"), half_extents=HALF_EXTENTS)
    by_key = {f.definition.key: (f.unit, f.measured_with) for f in boxes.figures}
    assert by_key["motp"] == ("", "3D-box (1 − GIoU)/2, gate 0.5")
    assert by_key["gospa_false"][0] == ""
    assert by_key["position_error"][0] == "m"


def test_json_holds_everything():
    truth, tracks = by_hand()
    result = evaluate(truth, tracks)
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert [f["key"] for f in data["figures"]] == [d.key for d in DEFINITIONS]
    assert data["figures"][0]["value"] == pytest.approx(0.375)
    assert "CLEAR" in data["figures"][0]["source"]
    assert all(len(values) == 4 for values in data["series"].values())
    assert data["errors"]["1"][3] is None
    assert data["pairs"]["people"] == [1, 2, 1, 1, 2, 2]
    assert sum(data["pairs"]["switch"]) == 2
    assert [row["id"] for row in data["tracks"]] == [10, 20, 30]


def test_compare():
    truth = walks(3)
    rough = evaluate(truth, perturbed(truth, 1, noise=0.3, missing=0.3))
    fine = evaluate(truth, perturbed(truth, 1, noise=0.05, missing=0.0, swaps=0, false=0))
    rows = {row.definition.key: row for row in compare(rough, fine)}
    for key in ("mota", "idf1", "hota", "ospa", "gospa", "position_error", "misses"):
        assert rows[key].verdict == "better", key
    shown = round(fine["mota"], 3) - round(rough["mota"], 3)
    assert rows["mota"].difference == pytest.approx(shown)
    for row in (*rows.values(), *compare(fine, rough)):  # a difference that is shown has a word
        figure = row.definition
        if row.verdict in ("better", "worse") and figure.direction != "zero":
            assert abs(row.difference or 0.0) >= 0.99 * 10.0**-figure.digits, figure.key
        elif row.verdict == "same":
            assert not row.difference or figure.direction == "zero", figure.key
    assert {row.verdict for row in compare(fine, fine)} == {"same"}
    back = {row.definition.key: row.verdict for row in compare(fine, rough)}
    assert back["mota"] == "worse"
    assert all(row.comparable for row in rows.values())
    other = evaluate(truth, perturbed(truth, 1), EvaluationSettings(gate=0.5))
    by_key = {row.definition.key: row for row in compare(rough, other)}
    assert not by_key["mota"].comparable
    assert by_key["found_share"].comparable
    nothing = evaluate(truth, perturbed(truth, 1, missing=1.0, swaps=0, false=0))
    by_key = {row.definition.key: row for row in compare(fine, nothing)}
    undefined = by_key["position_error"]
    assert (undefined.b, undefined.difference, undefined.verdict) == (None, None, "undefined")


@pytest.mark.parametrize(
    ("direction", "a", "b", "expected"),
    [
        ("higher", 0.5, 0.6, "better"),
        ("lower", 0.5, 0.6, "worse"),
        ("lower", 0.5001, 0.5004, "same"),
        ("zero", -0.5, 0.2, "better"),
        ("zero", 0.1, -0.4, "worse"),
        ("zero", 0.1, -0.1, "same"),
        ("none", 1, 2, "different"),
        ("higher", None, 0.2, "undefined"),
        ("higher", None, None, "same"),
    ],
)
def test_verdict(direction, a, b, expected: str):
    assert verdict(direction, 3, a, b) == expected


def test_numbers_are_written_alike():
    assert number(0.12345, 3) == "0.123"
    assert number(-0.0001, 3) == "0.000"
    assert number(-2.5, 1, sign=True) == "−2.5"
    assert number(7, 0, sign=True) == "+7"
    assert number(None, 3) == "–"

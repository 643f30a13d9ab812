"""The page's tables: the numbers of the engine in words, and nothing of a stranger as HTML."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi import FastAPI
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

from app.state.workbench import Workbench
from app.web.server import Settings, create_app
from app.web.tables import markup
from tests.app.conftest import ADDRESS, is_evaluated, run_is, wait_until
from tests.browser.walkers import write_walkers
from tracker.parameters.catalogue import PARAMETERS


def cells(html: str, label: str) -> list[list[str]]:
    """The body of a table, row by row, as text."""
    part = html.partition(f'aria-label="{label}"')[2].partition("</table>")[0]
    assert part, f"there is no table {label}"
    rows = re.findall(r"<tr>(.*?)</tr>", part.partition("<tbody>")[2], re.S)
    return [
        [re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row, re.S)]
        for row in rows
    ]


def get(client: TestClient, path: str) -> str:
    answer = client.get(f"/api/tables/{path}")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    return answer.text


@given(st.text())
def test_what_comes_from_outside_stays_text(text: str) -> None:
    for html in (
        markup.table(text, ["a", f"#{text}"], [[text, markup.button(text, text, text)]]),
        markup.line(text),
        markup.blank(text, text),
    ):
        inside = re.sub(r'="[^"]*"', "", html)
        tags = set(re.findall(r"<\s*/?\s*([^\s>]*)", inside))
        assert tags <= {
            *("table", "thead", "tbody", "tr", "th", "td", "button", "p", "div", "h3", "span")
        }


def test_numbers_are_written_for_people() -> None:
    assert markup.number(-0.0004, 3) == "0.000"
    assert markup.number(-1.5, 2, signed=True) == "−1.50"
    assert markup.number(1.5, 1, signed=True) == "+1.5"
    assert markup.number(None, 1) == markup.number(float("nan"), 1) == "–"
    assert markup.symbol("p_D").html == "<i>p</i><sub>D</sub>"
    assert markup.value_text(True) == "on"
    assert markup.value_text(0.1 + 0.2) == "0.3"
    assert markup.value_text("multi_bernoulli") == "multi_bernoulli"


def test_a_step_is_told_as_the_step_tells_it(client: TestClient) -> None:
    step = client.get("/api/step/60").json()
    html = get(client, "step/60")
    people = cells(html, "People in 3D at step 60")
    assert [row[0] for row in people] == [str(track["id"]) for track in step["tracks"]]
    for row, track in zip(people, step["tracks"], strict=True):
        assert row[2] == markup.vector(track["position"])
        error = next((p["error"] for p in step["truth"] if p["track"] == track["id"]), None)
        assert row[4] == markup.number(error, 3)
    pictures = cells(html, "Tracks in the pictures")
    assert len(pictures) == sum(len(camera["tracks"]) for camera in step["cameras"])
    first = step["cameras"][0]["tracks"][0]
    assert pictures[0][:4] == [
        step["cameras"][0]["name"],
        str(first["id"]),
        "seen" if first["seen"] else "coasting",
        markup.number(first["detection_probability"], 2),
    ]
    curves = dict(row[:2] for row in cells(html, "Curves at this step"))
    assert curves["People, true"] == str(len(step["truth"]))
    series = client.get("/api/evaluation/series").json()
    assert curves["OSPA  m"] == f"{series['ospa'][60]:.3f}"


@pytest.mark.full
def test_events_can_be_gone_to(client: TestClient, tmp_path: Path) -> None:
    assert "No such event" in get(client, "events")  # both are there from end to end
    client.post("/api/sequence", json={"name": str(write_walkers(tmp_path / "walkers"))})
    wait_until(run_is(client, "done"))
    wait_until(is_evaluated(client))
    timeline = client.get("/api/timeline").json()
    switches = client.get("/api/evaluation/series").json()["switches"]
    rows = cells(get(client, "events"), "Events")
    assert len(rows) == len(timeline["events"]) + len(switches)
    assert [int(row[0]) for row in rows] == sorted(int(row[0]) for row in rows)
    births = [event for event in timeline["events"] if event[2] == "birth"]
    html = get(client, "events?kind=birth")
    assert len(cells(html, "Events")) == len(births) > 0
    assert f'data-do="go" data-value="{births[0][0]} {births[0][1]}"' in html
    assert client.get("/api/tables/events?kind=party").status_code == 422


@pytest.mark.full
def test_changes_are_listed_with_their_reset(client: TestClient) -> None:
    assert "at their defaults" in get(client, "changes")
    client.patch("/api/parameters", json={"changes": {"fusion.detection_probability": 0.6}})
    client.patch("/api/parameters", json={"changes": {"fusion_method": "sequential_phd"}})
    html = get(client, "changes")
    rows = {row[1]: row for row in cells(html, "Changed parameters")}
    assert rows["Detection probability pD"][3].strip() == "0.6"
    assert rows["fusion method"][2] == "multi_bernoulli"
    assert 'data-do="reset" data-value="fusion.detection_probability"' in html
    wait_until(run_is(client, "done"))


def test_what_a_parameter_would_change_is_listed(client: TestClient) -> None:
    assert "What parameters would change" not in get(client, "changes")
    key = "fusion.extraction_threshold"
    assert client.post("/api/sensitivity", json={"keys": [key]}).status_code == 200
    assert client.post("/api/sensitivity", json={"keys": ["fusion.x"]}).status_code == 422
    wait_until(lambda: "What parameters would change" in get(client, "changes"))
    html = get(client, "changes")
    assert "All parameters stand at their defaults." in html
    stage, name, _, score = cells(html, "What parameters would change")[0]
    assert stage == "fusion"
    assert name.startswith("Extraction threshold")
    assert -1.0 <= float(score) <= 1.0


def test_figures_of_the_run_before_do_not_pass_for_the_shown_one(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait_until(is_evaluated(client))
    assert "<b>B</b> this run, " in get(client, "compare")
    application = client.app
    assert isinstance(application, FastAPI)
    bench: Workbench = application.state.workbench
    now = bench.snapshot()
    assert now.scores.shown is not None
    before = replace(now.scores, shown=replace(now.scores.shown, key="of another"))
    monkeypatch.setattr(bench, "snapshot", lambda: replace(now, scores=before))
    assert "<b>B</b> the run before, this one is being scored, " in get(client, "compare")


@pytest.mark.full
def test_the_comparison_is_the_evaluations(client: TestClient) -> None:
    alone = get(client, "compare")
    assert "no run to compare with" in alone
    figures = client.get("/api/evaluation").json()["figures"]
    headlines = [figure for figure in figures if figure["headline"]]
    assert len(cells(alone, "Figures")) == len(headlines) < len(figures)
    assert len(cells(get(client, "compare?every=true"), "Figures")) == len(figures)
    client.post("/api/run/pin")
    client.patch("/api/parameters", json={"changes": {"fusion.detection_probability": 0.3}})
    wait_until(run_is(client, "done"))
    wait_until(is_evaluated(client))
    told = client.get("/api/evaluation/comparison").json()
    html = get(client, "compare?every=true")
    rows = cells(html, "Figures")
    for row, wanted in zip(rows, told["rows"], strict=True):
        assert row[1] == markup.number(wanted["a"], wanted["digits"])
        assert row[2] == markup.number(wanted["b"], wanted["digits"])
        assert row[3] == markup.number(wanted["difference"], wanted["digits"], signed=True)
        assert row[4].endswith(wanted["verdict"]) or wanted["verdict"] == "undefined"
    default = markup.value_text(PARAMETERS["fusion.detection_probability"].default)
    assert cells(html, "Parameters that differ") == [["Detection probability pD", default, "0.3"]]
    assert "pinned run, default parameters" in html


@pytest.mark.full
def test_runs_are_listed_and_can_be_taken_up_again(own_client: TestClient) -> None:
    before = own_client.get("/api/state").json()
    own_client.patch("/api/parameters", json={"changes": {"fusion.detection_probability": 0.6}})
    own_client.patch("/api/parameters", json={"changes": {"fusion_method": "sequential_phd"}})
    wait_until(run_is(own_client, "done"))
    html = get(own_client, "runs")
    rows = cells(html, "Runs")
    assert [row[0] for row in rows] == sorted((row[0] for row in rows), key=int, reverse=True)
    assert rows[0][2] == "none · sequential_phd", "by their own names, as everywhere"
    assert rows[0][3] == rows[-1][3] == "computed"
    assert (rows[0][5], rows[-1][5]) == ("2", "0")
    assert (rows[0][6], rows[-1][6]) == ("current", "use again")
    assert 'data-do="useAgain" data-value="1"' in html
    after = own_client.post("/api/run/again/1").json()
    assert after["parameters"] == before["parameters"]
    assert after["methods"] == before["methods"]
    assert own_client.post("/api/run/again/99").status_code == 422
    wait_until(run_is(own_client, "done"))


@pytest.mark.parametrize("path", ["step/0", "events"])
def test_nothing_open(path: str) -> None:
    with TestClient(create_app(Settings(with_viser=False)), base_url=ADDRESS) as client:
        assert client.get(f"/api/tables/{path}").status_code == 409
        assert "once a sequence" in get(client, "compare")
        assert "at their defaults" in get(client, "changes")
        assert "No run yet" in get(client, "runs")

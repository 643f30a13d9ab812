"""The report: whole, self-contained, safe, and drawn without a complaint."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from tests.evaluation.scenes import CAMERA, HALF_EXTENTS, Columns, perturbed, truth_of, walks
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.evaluation.report.figures import DARK, LIGHT_IDS, broken, over_time, top_view
from tracker.evaluation.report.page import report_html, write_report
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.sequence import GroundTruth, Room, Sequence, View


def sequence_of(truth: GroundTruth | None, name: str = "room", description: str = "") -> Sequence:
    return Sequence(
        name=name,
        folder=Path(),
        fps=10.0,
        frames=40,
        room=Room(np.zeros(3), np.array([4.0, 4.0, 2.5])),
        target_half_extents=HALF_EXTENTS,
        views=(View(CAMERA),),
        description=description,
        ground_truth=truth,
    )


@pytest.fixture
def scene() -> tuple[Sequence, Columns]:
    truth = walks(2, uncertain=0.05)
    return sequence_of(truth), perturbed(truth, 3)


def figure(text: str, name: str) -> dict:
    """A figure as the report embeds it."""
    found = re.search(rf'id="{name}">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def body_of(text: str) -> str:
    """The report without the scripts."""
    return re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)


def test_one_file_that_needs_nothing(scene, tmp_path):
    sequence, tracks = scene
    path = tmp_path / "report.html"
    evaluation = evaluate_sequence(sequence, tracks)
    write_report(path, sequence, tracks, RunParameters(), evaluation, seed=7)
    text = path.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [path]
    assert text.count("* plotly.js v") == 1
    assert not re.search(r"(src|href)=[\"'](?!#)", body_of(text))
    assert "<script src" not in text
    assert "seed 7" in text
    for part in ("figures", "time", "paths", "people", "tracks", "cameras", "parameters"):
        assert f'<section id="{part}">' in text
    for entry in evaluation.figures:
        assert f">{entry.definition.name}<" in text
    assert "gate 1 m" in text


def test_changed_parameters_are_marked(scene):
    sequence, tracks = scene
    evaluation = evaluate_sequence(sequence, tracks)
    changed = with_values(RunParameters(), {"fusion.clutter_rate": 7.0})
    for parameters in (changed, {"fusion.clutter_rate": "7.0", "sequence": "room", "seed": "0"}):
        text = body_of(report_html(sequence, tracks, parameters, evaluation))
        assert text.count('<tr class="changed">') == 1
        assert re.search(r'<tr class="changed"><th scope="row">Clutter rate', text)
        assert "1 changed from the default" in text
    assert "all at their defaults" in report_html(sequence, tracks, RunParameters(), evaluation)
    assert "are not known" in report_html(sequence, tracks, None, evaluation)
    foreign = report_html(sequence, tracks, {"fusion.clutter_rate": "many"}, evaluation)
    assert "many" in body_of(foreign)


def test_a_reference_is_set_beside(scene):
    sequence, tracks = scene
    evaluation = evaluate_sequence(sequence, tracks)
    assert sequence.ground_truth is not None
    rough = evaluate_sequence(sequence, perturbed(sequence.ground_truth, 9, noise=0.5))
    text = body_of(report_html(sequence, tracks, None, evaluation, reference=rough))
    assert "▲ better" in text
    other = evaluate_sequence(sequence, tracks, EvaluationSettings(gate=0.5))
    assert "other settings" in report_html(sequence, tracks, None, evaluation, reference=other)


def test_names_cannot_break_out():
    truth = truth_of([(0, 1, 1, 1, 1)])
    nasty = "</script><script>alert(1)</script>"
    sequence = sequence_of(truth, nasty, nasty)
    tracks = perturbed(truth, 1, missing=0.0, swaps=0)
    text = report_html(sequence, tracks, {"x": nasty}, evaluate_sequence(sequence, tracks))
    assert nasty not in text


@pytest.mark.parametrize("truth", [None, truth_of([]), walks(1)])
@pytest.mark.parametrize("tracks", [Trajectories.empty(1), perturbed(walks(1), 2)])
@pytest.mark.parametrize("steps", [0, 40])
def test_nothing_to_show_is_shown(truth, tracks, steps: int):
    sequence = sequence_of(truth)
    evaluation = evaluate_sequence(sequence, tracks, steps=steps)
    text = report_html(sequence, tracks, RunParameters(), evaluation)
    assert '<section id="parameters">' in text
    assert ("0 of 40 steps" in text) == (steps == 0)


@pytest.mark.full
def test_tall_tables_scroll():
    truth = walks(1)
    tracks = perturbed(truth, 1, false=8.0)
    many = Columns(
        np.repeat(tracks.frames, 3), np.arange(3 * len(tracks.ids)), tracks.positions.repeat(3, 0)
    )
    sequence = sequence_of(truth)
    assert 'class="wide tall"' in report_html(
        sequence, many, None, evaluate_sequence(sequence, many)
    )


def test_every_colour_has_a_dark_partner(scene):
    sequence, tracks = scene
    evaluation = evaluate_sequence(sequence, tracks)
    text = over_time(evaluation).to_json() + top_view(sequence, tracks, evaluation).to_json()
    assert set(re.findall(r"#[0-9a-f]{6}\b", text)) <= set(DARK)
    assert len(set(LIGHT_IDS)) == len(set(DARK.values()) & set(DARK[tone] for tone in LIGHT_IDS))


def test_lines_break_at_gaps():
    frames, x = broken(np.array([3, 4, 7]), np.array([1.0, 2.0, 3.0]))
    assert np.array_equal(frames, [3, 4, np.nan, 7], equal_nan=True)
    assert np.array_equal(x, [1, 2, np.nan, 3], equal_nan=True)
    assert len(broken(np.zeros(0, int), np.zeros(0))[0]) == 0


@pytest.mark.parametrize("steps", [9, 10, 40])
def test_paths_end_with_the_steps_that_are_scored(scene, steps: int):
    sequence, tracks = scene
    figure = top_view(sequence, tracks, evaluate_sequence(sequence, tracks, steps=steps))
    for word in ("person", "track"):
        shown = [t.customdata for t in figure.data if word in str(t.hovertemplate)]
        assert np.nanmax(np.concatenate(shown)) == steps - 1


def test_paths_that_cannot_be_written(scene, tmp_path):
    sequence, tracks = scene
    evaluation = evaluate_sequence(sequence, tracks)
    with pytest.raises(IsADirectoryError, match="add a name"):
        write_report(tmp_path, sequence, tracks, None, evaluation)
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_report(tmp_path / "none" / "a.html", sequence, tracks, None, evaluation)


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_browser_draws_it(scene, tmp_path, browser: Browser, scheme: str):
    sequence, tracks = scene
    path = tmp_path / "report.html"
    write_report(path, sequence, tracks, RunParameters(), evaluate_sequence(sequence, tracks))
    complaints: list[str] = []
    requests: list[str] = []
    page = browser.new_page(color_scheme=scheme, viewport={"width": 1100, "height": 800})
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("request", lambda request: requests.append(request.url))
    page.goto(path.as_uri())
    page.wait_for_function("document.querySelectorAll('.plot .main-svg').length >= 2")
    surface = page.eval_on_selector("body", "e => getComputedStyle(e).backgroundColor")
    painted = page.eval_on_selector(".plot .main-svg", "e => e.style.background")
    width = page.evaluate("document.documentElement.scrollWidth")
    page.close()
    assert complaints == []
    assert requests == [path.as_uri()]
    assert painted == surface
    assert width <= 1100

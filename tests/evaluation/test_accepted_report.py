"""The whole report of a small scene is the one that was accepted, but for script and parameters.

``pytest tests/evaluation --update-golden`` accepts a change; see what changed with ``git diff``.
"""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.evaluation.scenes import HALF_EXTENTS, truth_of
from tests.world import ring
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.evaluation.report.page import report_html
from tracker.evaluation.report.tables import parameter_table
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import stage_values, value_of, with_values
from tracker.sequences.sequence import Room, Sequence, View

ACCEPTED = Path(__file__).with_name("accepted_report.html")


def scene() -> tuple[Sequence, Trajectories, Trajectories]:
    """Three people of whom one is uncertain, tracks with a switch, a gap and a false one."""
    truth = truth_of(
        [(t, k, 1.5 * k + 0.1 * t, 0.5 * k, 0.9) for t in range(8) for k in (1, 2, 3)],
        valid=[k < 3 or t < 6 for t in range(8) for k in (1, 2, 3)],
    )
    moved = truth.positions + np.array([0.1, -0.05, 0.0])
    ids = np.where((truth.frames > 4) & (truth.ids < 3), 3 - truth.ids, truth.ids) + 10
    kept = ~((truth.ids == 1) & np.isin(truth.frames, [2, 6]))
    frames = np.append(truth.frames[kept], [0, 1])
    ids, places = np.append(ids[kept], [40, 40]), np.concatenate([moved[kept], [[0.2, 4, 1]] * 2])
    count = len(frames)
    tracks = Trajectories(
        frames, ids, places, np.linspace(0.5, 1.0, count), np.full((count, 3), 0.1),
        np.ones((count, 2), dtype=bool), np.zeros(count, dtype=np.int64), ids, np.zeros(count),
        np.full(count, np.nan), np.full(count, np.nan),
    )  # fmt: skip
    sequence = Sequence(
        name="small & odd", folder=Path(), fps=12.5, frames=9,
        room=Room(np.array([-1.0, -2.0, 0.0]), np.array([6.0, 4.5, 2.5])),
        target_half_extents=HALF_EXTENTS, views=tuple(View(camera) for camera in ring(2)),
        description="three people", ground_truth=truth,
    )  # fmt: skip
    rough = replace(tracks, positions=np.add(tracks.positions, [0.2, 0.0, 0.0]))
    return sequence, tracks, rough


def readable(text: str) -> str:
    """The report without scripts, style and version, one line for each row, trace and axis."""
    figures = re.findall(r'json" id="(figure-\w+)">(.*?)</script>', text, flags=re.DOTALL)
    text = re.sub(r"<(script|style).*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r"multiview-phd [^\s\".]+(\.[^\s\".]+)*", "multiview-phd VERSION", text)
    lines = [text.replace("<tr", "\n<tr").replace("<section", "\n<section")]
    for name, figure in figures:
        content = _in_words(json.loads(figure))
        lines += [f"{name} {json.dumps(trace, sort_keys=True)}" for trace in content["data"]]
        for key, part in sorted(content["layout"].items()):
            lines.append(f"{name} {key} {json.dumps(part, sort_keys=True)}")
    return "\n".join(lines) + "\n"


def _in_words(part: Any) -> Any:
    """Numbers with nine digits instead of their bytes: their last bits differ by the processor."""
    if isinstance(part, list):
        return [_in_words(one) for one in part]
    if not isinstance(part, dict):
        return float(f"{part:.9g}") if isinstance(part, float) else part
    if set(part) < {"bdata", "dtype", "shape"}:
        numbers = np.frombuffer(base64.b64decode(part["bdata"]), part["dtype"])
        return [float(f"{number:.9g}") for number in numbers.tolist()]
    return {key: _in_words(one) for key, one in part.items()}


def test_the_report_is_the_accepted_one(request: pytest.FixtureRequest) -> None:
    sequence, tracks, rough = scene()
    settings = EvaluationSettings(window=3)
    evaluation = evaluate_sequence(sequence, tracks, settings, steps=8)
    reference = evaluate_sequence(sequence, rough, settings.model_copy(update={"near": 0.2}))
    powers = evaluate_sequence(sequence, tracks, EvaluationSettings(order=2.0, distance="box"))
    found = readable(
        report_html(
            sequence, tracks, None, evaluation, reference=reference, seed=7, back="/runs/1?a=b&c"
        )
    ) + readable(report_html(sequence, tracks, None, powers))
    if request.config.getoption("--update-golden"):
        ACCEPTED.write_text(found, encoding="utf-8")
    assert found.splitlines() == ACCEPTED.read_text(encoding="utf-8").splitlines()


def test_the_table_of_parameters_has_a_row_for_each_that_is_used() -> None:
    sequence, _, _ = scene()
    parameters = with_values(RunParameters(), {"fusion.clutter_rate": 7.25})
    text = parameter_table(parameters, sequence)
    rows = re.findall(r"<tr[^>]*><th scope=\"row\">(.*?)</th>(.*?)</tr>", text)
    used = list(METHODS)
    for stage in ("single_view", "fusion", "smoothing", "tracks"):
        used += [key for key in stage_values(parameters, stage) if key not in used]
    assert len(rows) == len(used)
    assert text.startswith(f"<p class='muted'>{len(used)} parameters, ")
    for key, (head, cells) in zip(used, rows, strict=True):
        told = re.findall(r"<td[^>]*>(.*?)</td>", cells)
        now, before = value_of(parameters, key), value_of(RunParameters(), key)
        shown = [f"{v:g}" if isinstance(v, float) else str(v) for v in (now, before)]
        assert [told[1], told[3]] == shown, key
        if key in PARAMETERS:
            assert head == PARAMETERS[key].label
    groups = re.findall(r'<th colspan="6" scope="rowgroup">(.*?)</th>', text)
    assert groups == ["colour_phd", "Pictures", "Foreground", "Fusion", "Smoothing", "Fusion"]
    assert re.findall(r'<tr class="changed"><th scope="row">(.*?)</th>', text) == ["Clutter rate"]

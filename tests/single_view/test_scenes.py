"""One scene for every method with pictures: two heads before a small camera.

What each finds is compared with ``scenes.json``; ``--update-golden`` accepts it as it is.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tracker import single_view
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader, Picture
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour import peaks
from tracker.single_view.colour.trust import shapes_of_templates
from tracker.single_view.pictures.background import unpack
from tracker.single_view.protocol import ViewResult, unpack_samples

KEPT = Path(__file__).with_name("scenes.json")

SMALL = {"foreground.minimum_area": 4, "foreground.threshold": 30.0}
PUBLISHED = PRESETS["published"] | SMALL

VARIANTS: dict[str, dict[str, Any]] = {
    "colours": {"single_view": "colour_phd", "colour_phd.samples": 60,
                "colour_phd.mean_shift_starts": 4, "colour_phd.birth": "both"},
    "colours and shapes": {"single_view": "colour_phd", "colour_phd.samples": 40,
                           "colour_phd.mean_shift_starts": 3, "colour_phd.shapes": "always",
                           "colour_phd.shape_odds": -1.0},
    "colours, published": PUBLISHED | {"single_view": "colour_phd", "colour_phd.samples": 90,
                                       "colour_phd.mean_shift_starts": 6},
    "particles": {"single_view": "pseudo_particle", "colour_phd.samples": 80},
    "particles, published": PUBLISHED | {"single_view": "pseudo_particle",
                                         "colour_phd.samples": 160},
    "particles, classical": {"single_view": "pseudo_particle", "colour_phd.samples": 60,
                             "pseudo_particle.filter": "classical"},
    "crowns": {"single_view": "jpda", "jpda.confirmation_steps": 2},
    "pieces": {"single_view": "jpda", "jpda.confirmation_steps": 2,
               "jpda.foreground_box": "piece", "jpda.output": "measurements"},
    "associated peaks": {"single_view": "jpda", "jpda.confirmation_steps": 1,
                         "jpda.measurements": "colour", "colour_phd.samples": 60,
                         "colour_phd.mean_shift_starts": 4},
    "matrices": {"single_view": "association_matrix", "association_matrix.confirmation_steps": 2},
    "matrices, published": PUBLISHED | {
        "single_view": "association_matrix", "foreground.least_threshold": 20.0,
    },
    "shapes": {"single_view": "shapes", "shapes.least_odds": -2.0, "shapes.passed_odds": -3.0},
}  # fmt: skip
every_variant = pytest.mark.parametrize("variant", VARIANTS)


def method_of(
    variant: str, sequence: Sequence, reader: FrameReader, **changes: Any
) -> single_view.SingleViewMethod:
    values = SMALL | VARIANTS[variant] | changes
    parameters = with_values(RunParameters(), values)
    return single_view.create(parameters.single_view, sequence, 0, parameters, reader)


def run(
    method: single_view.SingleViewMethod, pictures: Iterable[Picture | None], seed: int = 0
) -> tuple[Any, list[ViewResult]]:
    state, results = method.start(), []
    for step, picture in enumerate(pictures):
        state, result = method.step(state, step, picture, np.random.default_rng((seed, step)))
        results.append(result)
    return state, results


def film(reader: FrameReader, steps: int = 8) -> list[Picture | None]:
    return [reader.picture(0, step) for step in range(steps)]


def numbers(result: ViewResult) -> list[float]:
    """Counts, and sums of all columns: swapped ones or rows that are another's would show."""
    parts: list[ndarray] = []
    for boxes, beside in (
        (result.boxes, result.weights), (result.sigmas, result.labels),
        (result.estimates, result.estimate_weights), (result.estimates, result.estimate_labels),
        (result.measurements, result.measurement_scores), unpack_samples(result.samples),
        (result.gates, np.ones(len(result.gates))), (result.dropped.boxes, result.dropped.gates),
    ):  # fmt: skip
        rows = np.column_stack([boxes, beside]).astype(float)
        rows = rows[np.lexsort(np.round(rows, 3).T)]
        places = 1.0 + 0.1 * np.arange(len(rows))
        parts += [np.array([len(rows)]), places @ rows]
    mask = np.zeros((1, 1)) if result.foreground is None else unpack(result.foreground)
    parts += [np.array([mask.sum(), np.flatnonzero(mask).sum()])]
    parts += [np.array([result.log_ratios.sum(), len(result.events),
                        sum(sum(event.labels) for event in result.events)])]  # fmt: skip
    parts += [np.array([value for _, value in sorted(result.information.items())])]
    return [float(f"{number:.9g}") for number in np.concatenate(parts)]


def stays(name: str, found: list[list[float]], request: pytest.FixtureRequest) -> None:
    """Compare rows of numbers with those of the file, or accept them."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}
    if request.config.getoption("--update-golden"):
        found = [[float(f"{number:.9g}") for number in row] for row in found]
        lines = [f" {json.dumps(one)}: {json.dumps(rows)}" for one, rows in
                 (kept | {name: found}).items()]  # fmt: skip
        KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
        return
    for number, (row, expected) in enumerate(zip(found, kept[name], strict=True)):
        assert_allclose(row, expected, rtol=1e-6, atol=1e-7, err_msg=f"row {number}")


@every_variant
def test_what_a_method_finds_stays_what_it_was(
    variant: str, heads: Sequence, reader: FrameReader, request: pytest.FixtureRequest
) -> None:
    _, results = run(method_of(variant, heads, reader), film(reader))
    stays(variant, [numbers(results[step]) for step in (1, 3, 6)], request)


def test_people_by_shape_that_lie_where_the_templates_are_go_on_with_their_odds(
    heads: Sequence,
    reader: FrameReader,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    monkeypatch.setattr(peaks, "FITTING", 0.0)  # heads alone are of no shape that would fit
    method = method_of(
        "colours and shapes",
        heads,
        reader,
        **{"colour_phd.shapes": "fitting", "colour_phd.shape_odds": -3.0},
    )
    _, results = run(method, film(reader))
    found = [numbers(results[step]) for step in (1, 3, 6)]
    assert all(len(results[step].log_ratios) for step in (1, 3, 6))
    by_shape = shapes_of_templates(heads, reader)
    found.append([*(by_shape.trust[name] for name in sorted(by_shape.trust)), by_shape.fit])
    stays("colours and fitting shapes", found, request)


def test_people_by_shape_carry_the_ids_of_the_targets_at_their_boxes(
    heads: Sequence, reader: FrameReader
) -> None:
    method: Any = method_of("shapes", heads, reader)
    _, (first, *_) = run(method_of("crowns", heads, reader), film(reader, 1))
    windows = np.array([[20.0, 30.0, 4.0, 6.0], [60.0, 30.0, 5.0, 7.0], [90.0, 40.0, 4.0, 5.0]])
    tracked = replace(
        first, boxes=windows[[2, 0]], weights=np.ones(2), labels=np.array([7, 4]),
        sigmas=np.ones((2, 4)), measurements=windows, measurement_scores=np.array([0.9, 0.5, 0.6]),
    )  # fmt: skip
    method._tracking = SimpleNamespace(step=lambda *_: ("state", tracked))
    state, found = method.step(None, 0, None, np.random.default_rng(0))
    assert state == "state"
    assert found.labels.tolist() == [4, -1, 7], "what no target has goes on without an id"
    assert_allclose(found.boxes, windows)
    assert_allclose(found.weights, [0.9, 0.5, 0.6])
    assert found.log_ratios[0] > found.log_ratios[2] > found.log_ratios[1]


def truth(heads: Sequence, step: int) -> ndarray:
    assert heads.ground_truth is not None
    places = heads.ground_truth.positions[heads.ground_truth.at(step)]
    return world.upright(heads.cameras[0], places, world.HEAD)


@pytest.mark.parametrize("variant", [one for one in VARIANTS if one != "shapes"])
def test_both_heads_are_found_where_they_are(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    _, results = run(method_of(variant, heads, reader), film(reader))
    near = []
    for step in range(3, 8):
        boxes = results[step].measurements
        for box in truth(heads, step):
            apart = np.abs((boxes[:, :2] - box[:2]) / box[2:]).max(axis=1, initial=0.0)
            near.append(len(apart) > 0 and apart.min() < 1.0)
    assert np.mean(near) > (0.3 if "classical" in variant else 0.65)

"""The fusion on real detections and real paths, with what must hold as bounds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tracker.evaluation import Evaluation, EvaluationSettings, evaluate_sequence
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Detections, Sequence

pytestmark = pytest.mark.data

METHODS = ("multi_bernoulli", "sequential_phd")
both_methods = pytest.mark.parametrize("method", METHODS)


def parameters(method: str, **changes: object) -> RunParameters:
    """The defaults for boxes, with some values changed."""
    values = {"single_view": "none", "fusion_method": method}
    return with_values(RunParameters(), {**values, **changes})


def scored(sequence: Sequence, run: Run, gate: float = 1.0) -> Evaluation:
    """By 3D centres."""
    return evaluate_sequence(sequence, run.tracks, EvaluationSettings(gate=gate))


def number(evaluation: Evaluation, key: str) -> float:
    value = evaluation[key]
    assert value is not None
    return float(value)


def without(sequence: Sequence, camera: int, first: int, last: int) -> Sequence:
    """One camera gives no box from a step on, up to another."""
    view = sequence.views[camera]
    assert view.detections is not None
    kept = (view.detections.frames < first) | (view.detections.frames >= last)
    blind = Detections(
        view.detections.frames[kept], view.detections.boxes[kept], view.detections.scores[kept]
    )
    views = list(sequence.views)
    views[camera] = replace(view, detections=blind)
    return replace(
        sequence, views=tuple(views), digest=f"{sequence.digest}-{camera}-{first}-{last}"
    )


@pytest.mark.parametrize(
    ("method", "name", "mota", "idf1", "ospa2"),
    [
        ("multi_bernoulli", "cmc1", 0.995, 0.995, 0.1),
        ("multi_bernoulli", "cmc2", 0.985, 0.97, 0.18),
        ("sequential_phd", "cmc1", 0.99, 0.99, 0.1),
        ("sequential_phd", "cmc2", 0.97, 0.97, 0.25),
    ],
)
def test_people_in_a_crowded_room(
    data_folder: Path, method: str, name: str, mota: float, idf1: float, ospa2: float
) -> None:
    sequence = read_sequence(data_folder / name)
    found = scored(sequence, pipeline.compute(sequence, parameters(method)))
    assert number(found, "mota") >= mota
    assert number(found, "idf1") >= idf1
    assert number(found, "ospa2_whole") <= ospa2


@both_methods
def test_heads_that_hide_and_leave(data_folder: Path, method: str) -> None:
    sequence = read_sequence(data_folder / "av163-seq45-3p-1111-points")
    found = scored(sequence, pipeline.compute(sequence, parameters(method)), gate=0.5)
    assert number(found, "mota") >= 0.97
    assert number(found, "position_error") <= 0.03
    assert number(found, "id_switches") <= 3


@both_methods
def test_a_camera_that_is_taken_away_or_fails_for_a_while(data_folder: Path, method: str) -> None:
    sequence = read_sequence(data_folder / "cmc2")
    whole = number(scored(sequence, pipeline.compute(sequence, parameters(method))), "mota")
    for camera, last in ((0, 160), (1, sequence.frames), (2, 160), (3, sequence.frames)):
        blind = without(sequence, camera, 100, last)
        mota = number(scored(blind, pipeline.compute(blind, parameters(method))), "mota")
        assert mota >= whole - 0.05


@both_methods
def test_the_filter_in_the_picture_serves_as_well(data_folder: Path, method: str) -> None:
    for name, mota in (("cmc1", 0.985), ("cmc2", 0.96)):
        sequence = read_sequence(data_folder / name)
        run = pipeline.compute(sequence, parameters(method, single_view="detection_phd"))
        assert number(scored(sequence, run), "mota") >= mota


def test_the_published_scheme_stays_behind(data_folder: Path) -> None:
    from tracker.parameters.catalogue import PRESETS

    sequence = read_sequence(data_folder / "cmc2")
    published = with_values(parameters("sequential_phd"), PRESETS["published"])
    run = pipeline.compute(sequence, published)
    assert 0.3 < number(scored(sequence, run), "mota") < 0.9


def particles_on_video(folder: Path, seed: int, steps: int) -> Evaluation:
    """The particle filter's clusters as boxes, fused with the default parameters."""
    sequence = read_sequence(folder / "av163-seq30-2p-1101")
    chosen = with_values(pipeline.default_parameters(sequence), {"single_view": "pseudo_particle"})
    run = pipeline.compute(sequence, chosen, seed=seed, steps=steps)
    return evaluate_sequence(sequence, run.tracks, EvaluationSettings(gate=0.3), steps=steps)


def test_heads_on_the_beginning_of_real_video_by_particles(data_folder: Path) -> None:
    found = particles_on_video(data_folder, seed=0, steps=120)
    assert number(found, "found_share") >= 0.85
    assert number(found, "position_error") <= 0.12


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_heads_on_real_video_by_particles(data_folder: Path, seed: int) -> None:
    found = particles_on_video(data_folder, seed, steps=500)
    assert number(found, "found_share") >= 0.9
    assert number(found, "position_error") <= 0.1
    assert number(found, "false_per_step") <= 0.15


def heads(folder: Path, seed: int, steps: int | None = None) -> Evaluation:
    """The defaults on real video, by a gate of 0.3 m."""
    sequence = read_sequence(folder / "av163-seq30-2p-1101")
    parameters = pipeline.default_parameters(sequence)
    assert parameters.fusion_method == "multi_bernoulli"
    run = pipeline.compute(sequence, parameters, seed=seed, steps=steps)
    return scored(sequence, run, gate=0.3)


def test_heads_on_the_beginning_of_a_real_video(data_folder: Path) -> None:
    found = heads(data_folder, seed=0, steps=150)
    assert number(found, "position_error") <= 0.1
    assert number(found, "false_per_step") <= 0.1


@pytest.mark.long
def test_heads_on_real_video_over_five_seeds(data_folder: Path) -> None:
    found = [heads(data_folder, seed) for seed in range(5)]

    def mean(figure: str) -> float:
        return sum(number(one, figure) for one in found) / len(found)

    assert mean("found_share") >= 0.9
    assert mean("position_error") <= 0.1
    assert mean("false_per_step") <= 0.1
    assert mean("idf1") >= 0.75


@pytest.mark.parametrize(
    ("name", "gate", "mota", "idf1", "error"),
    [
        ("cmc1", 1.0, 0.997, 0.998, 0.09),
        ("cmc2", 1.0, 0.99, 0.995, 0.11),
        ("av163-seq45-3p-1111-points", 0.5, 0.999, 0.999, 0.012),
        ("wildtrack-points-300", 1.0, 0.88, 0.83, 0.08),
    ],
)
def test_hindsight_makes_boxes_better(
    data_folder: Path, name: str, gate: float, mota: float, idf1: float, error: float
) -> None:
    sequence = read_sequence(data_folder / name)
    settled = with_values(parameters("multi_bernoulli"), {"smoothing_method": "identities"})
    run = pipeline.compute(sequence, settled)
    found = scored(sequence, run, gate)
    assert number(found, "mota") >= mota
    assert number(found, "idf1") >= idf1
    assert number(found, "position_error") <= error
    alone = evaluate_sequence(sequence, run.filtered, EvaluationSettings(gate=gate))
    assert number(found, "mota") >= number(alone, "mota") - 0.002
    assert number(found, "idf1") >= number(alone, "idf1") - 0.002

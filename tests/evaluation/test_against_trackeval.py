"""CLEAR, identity and HOTA against TrackEval, the field's reference.

TrackEval is fed as its own datasets feed it: ids from 0, what is "don't care" taken
out, and similarities made from metres: 1 − d / (2 gate) with a threshold of 1/2 for
CLEAR and identity (as its MOT15-3D does), 1 − d / gate for HOTA.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from tests.evaluation.scenes import (
    Columns,
    as_truth,
    columns_of,
    comparison,
    perturbed,
    recording,
    scattered,
    walks,
)
from tracker.evaluation.clear import clear
from tracker.evaluation.hota import hota
from tracker.evaluation.identity import identity
from tracker.sequences.sequence import GroundTruth

metrics = pytest.importorskip(
    "trackeval.metrics",
    reason="TrackEval is not installed (pip install --no-deps trackeval)",
)


def prepared(truth: GroundTruth, tracks: Columns, gate: float, zero: float) -> dict[str, Any]:
    """The data of one sequence for TrackEval, "don't care" taken out step by step."""
    names = {name: k for k, name in enumerate(np.unique(truth.ids[truth.valid]).tolist())}
    steps = int(max(truth.frames.max(initial=-1), tracks.frames.max(initial=-1))) + 1
    gt_ids, track_ids, similarities = [], [], []
    for step in range(steps):
        people, estimates = truth.frames == step, tracks.frames == step
        valid = truth.valid[people]
        apart = truth.positions[people][:, None] - tracks.positions[estimates][None]
        distances = np.linalg.norm(apart, axis=2)
        score = 1.0 - np.where(valid[:, None], 1.0, 2.0) * distances / (2.0 * gate)
        score[distances > gate] = 0.0
        rows, columns = linear_sum_assignment(-score)
        aside = columns[(score[rows, columns] > 0.0) & ~valid[rows]]
        kept = np.setdiff1d(np.arange(distances.shape[1]), aside)
        gt_ids.append(np.array([names[k] for k in truth.ids[people][valid].tolist()], dtype=int))
        track_ids.append(tracks.ids[estimates][kept])
        similarities.append(np.maximum(0.0, 1.0 - distances[valid][:, kept] / zero))
    used = np.unique(np.concatenate([np.zeros(0, int), *track_ids]))
    track_ids = [np.searchsorted(used, ids) for ids in track_ids]
    return {
        "num_timesteps": steps,
        "num_gt_ids": len(names),
        "num_tracker_ids": len(used),
        "num_gt_dets": sum(map(len, gt_ids)),
        "num_tracker_dets": sum(map(len, track_ids)),
        "gt_ids": gt_ids,
        "tracker_ids": track_ids,
        "similarity_scores": similarities,
    }


def assert_equal(truth: GroundTruth, tracks: Columns, gate: float = 1.0) -> None:
    """Every figure of the three families agrees to 1e-9."""
    ours = comparison(truth, tracks, gate=gate)
    data = prepared(truth, tracks, gate, 2.0 * gate)
    exact = {"rel": 0, "abs": 1e-9}

    reference = metrics.CLEAR({"THRESHOLD": 0.5, "PRINT_CONFIG": False}).eval_sequence(data)
    score = clear(ours)
    assert score.misses.sum() == reference["CLR_FN"]
    assert score.false_positives.sum() == reference["CLR_FP"]
    assert score.id_switches.sum() == reference["IDSW"]
    assert score.fragmentations.sum() == reference["Frag"]
    for word, name in (("mostly tracked", "MT"), ("partly tracked", "PT"), ("mostly lost", "ML")):
        assert score.statuses.count(word) == reference[name]
    if score.mota is not None:
        assert score.mota == pytest.approx(reference["MOTA"], **exact)
    if score.motp is not None:
        assert 1.0 - score.motp / (2.0 * gate) == pytest.approx(reference["MOTP"], **exact)

    reference = metrics.Identity({"THRESHOLD": 0.5, "PRINT_CONFIG": False}).eval_sequence(data)
    own = identity(ours)
    assert own.true_positives == reference.get("IDTP", 0)
    assert own.false_positives == reference["IDFP"]
    assert own.false_negatives == reference["IDFN"]
    for value, name in ((own.f1, "IDF1"), (own.precision, "IDP"), (own.recall, "IDR")):
        if value is not None:
            assert value == pytest.approx(reference[name], **exact)

    reference = metrics.HOTA().eval_sequence(prepared(truth, tracks, gate, gate))
    by_alpha = hota(ours)
    if by_alpha is None:
        assert data["num_gt_dets"] == data["num_tracker_dets"] == 0
        return
    assert by_alpha.detection == pytest.approx(reference["DetA"], **exact)
    assert by_alpha.association == pytest.approx(reference["AssA"], **exact)
    assert by_alpha.localisation == pytest.approx(reference["LocA"], **exact)
    assert by_alpha.hota == pytest.approx(reference["HOTA"], **exact)


@pytest.mark.data
@pytest.mark.parametrize("name", ["cmc1", "cmc2", "av163-seq30-2p-1101"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_recordings_with_perturbed_truth(name: str, seed: int):
    truth = recording(name).ground_truth
    assert truth is not None
    noise, missing, false = {1: (0.1, 0.05, 0.2), 2: (0.3, 0.2, 1.0), 3: (0.6, 0.4, 3.0)}[seed]
    tracks = perturbed(truth, seed, noise=noise, missing=missing, false=false, swaps=3 * seed)
    assert_equal(truth, tracks)


@pytest.mark.data
@pytest.mark.parametrize("name", ["cmc1", "cmc2"])
def test_recordings_with_tracks_anywhere(name: str):
    truth = recording(name).ground_truth
    assert truth is not None
    assert_equal(truth, scattered(5, ids=12, steps=261, size=6.0))


@given(
    seed=st.integers(0, 10_000),
    gate=st.sampled_from([0.3, 1.0, 2.5]),
    uncertain=st.sampled_from([0.0, 0.3]),
    noise=st.sampled_from([0.05, 0.3, 1.0]),
)
def test_walks(seed: int, gate: float, uncertain: float, noise: float):
    truth = walks(seed, uncertain=uncertain)
    assert_equal(truth, perturbed(truth, seed + 1, noise=noise), gate)


@given(
    seed=st.integers(0, 10_000),
    people=st.integers(0, 6),
    tracks=st.integers(0, 6),
    steps=st.integers(1, 30),
    share=st.sampled_from([0.15, 0.5, 1.0]),
)
def test_random_tracks(seed: int, people: int, tracks: int, steps: int, share: float):
    truth = as_truth(scattered(seed, ids=people, steps=steps, share=share))
    assert_equal(truth, scattered(seed + 1, ids=tracks, steps=steps, share=share))


def test_truth_itself_is_perfect():
    truth = walks(4)
    assert_equal(truth, columns_of(truth))
    score, own, by_alpha = (
        f(comparison(truth, columns_of(truth))) for f in (clear, identity, hota)
    )
    assert score.mota == own.f1 == 1.0
    assert by_alpha.hota.tolist() == [1.0] * 19

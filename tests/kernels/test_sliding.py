"""Boxes slid in time against least squares, offset by offset and step by step."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tracker.kernels.consistency import slide

SIGMA, DEPTH_SIGMA = 0.1, 0.2
FRAMES = [2, 1, 0, 2, 1]  # boxes of each frame


def scene(seed: int) -> dict[str, np.ndarray]:
    """Three sampled steps with 1, 2 and 0 expected boxes, of which one is unknown."""
    rng = np.random.default_rng(seed)
    head = rng.uniform(0.0, 40.0, (6, 2))
    boxes = np.concatenate([head, head + rng.uniform([0, 30], [3, 60], (6, 2))], axis=1)
    boxes[4] = np.nan  # cut off
    expected = boxes[[0, 2, 3]] + rng.normal(0.0, 4.0, (3, 4))
    expected[2] = np.nan
    return {
        "expected": expected,
        "tangents": rng.normal(0.0, 20.0, (3, 4)),
        "starts": np.array([0, 1, 3, 3]),
        "steps": np.array([0, 1, 4]),
        "boxes": boxes,
        "following": np.array([2, -1, -1, 5, 5, -1]),
        "box_starts": np.cumsum([0, *FRAMES]),
        "offsets": np.array([0.0, 1.0, -1.0, 0.5, 2.75, 3.0]),
    }


@pytest.mark.parametrize("seed", range(6))
def test_each_expected_box_has_its_best_fit(seed: int) -> None:
    s = scene(seed)
    fits, counts = slide(*s.values(), SIGMA, DEPTH_SIGMA)
    for o, offset in enumerate(s["offsets"]):
        whole, part = int(np.floor(offset)), offset % 1.0
        for k, step in enumerate(s["steps"]):
            frame = step + whole
            if frame < 0 or frame >= len(FRAMES) or (part and frame + 1 >= len(FRAMES)):
                assert fits[o, k] == counts[o, k] == 0.0
                continue
            there = []
            for d in range(s["box_starts"][frame], s["box_starts"][frame + 1]):
                after = s["following"][d]
                if part == 0.0:
                    there.append(s["boxes"][d])
                elif after >= 0:
                    there.append((1.0 - part) * s["boxes"][d] + part * s["boxes"][after])
            total, known = 0.0, 0
            for n in range(s["starts"][k], s["starts"][k + 1]):
                if np.isnan(s["expected"][n, 0]):
                    continue
                known += 1
                squares = [18.0]
                for box in there:
                    height = box[3] - box[1]
                    if np.isfinite(height):
                        # r = λ g / height + σ noise, λ = 0 + σ_λ noise, by least squares
                        rows = np.append(s["tangents"][n] / height / SIGMA, 1.0 / DEPTH_SIGMA)
                        right = np.append((box - s["expected"][n]) / height / SIGMA, 0.0)
                        factor = rows @ right / (rows @ rows)
                        squares.append(float(((right - factor * rows) ** 2).sum()))
                total += np.exp(-0.5 * min(squares))
            assert counts[o, k] == known
            assert fits[o, k] == pytest.approx(total, rel=1e-9)
    assert counts.sum() > 6


def test_an_offset_a_hair_below_a_step_is_that_step() -> None:
    s = scene(0)
    exact, _ = slide(*s.values(), SIGMA, DEPTH_SIGMA)
    s["offsets"] = s["offsets"] - np.array([1e-10, 1e-10, -1e-8, 0.0, 0.0, 1e-10])
    near, counts = slide(*s.values(), SIGMA, DEPTH_SIGMA)
    assert_allclose(near, exact)
    assert_array_equal(counts[:, 2] > 0, False)

"""A fetched network is the default where whole people stand who are large enough for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.runs.test_gates import film
from tracker.runs import fitting


@pytest.mark.parametrize(
    ("pixels", "half_height", "suits"),
    [
        (100.0, 0.9, True), (99.9, 0.9, False), (100.0, 0.6, True), (100.0, 0.59, False),
        (100.0, 1.1, True), (100.0, 1.11, False),
    ],
)  # fmt: skip
def test_standing_people_of_a_hundred_pixels_suit_a_network(
    pixels: float,
    half_height: float,
    suits: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sequence = film(tmp_path, stays=False)
    sequence = replace(sequence, target_half_extents=np.array([0.3, 0.3, half_height]))
    sizes = SimpleNamespace(sizes=np.array([[10.0, 1.0], [10.0, pixels / 2.0], [10.0, 400.0]]))
    monkeypatch.setattr(fitting.BoxSizes, "of", lambda *_: sizes)
    assert fitting.suits_detector(sequence) == suits

"""Tracks as bytes: what comes back, and how small they are."""

from __future__ import annotations

import dataclasses
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.library.runs import KEPT, tracks
from tracker.fusion.trajectories import Trajectories
from tracker.library.columns import KeptTracks, pack, unpack

EXACT = ("frames", "ids", "positions", "seen", "components", "labels")


def test_positions_and_ids_come_back_exactly() -> None:
    back = unpack(pack(KEPT))
    for name in EXACT:
        np.testing.assert_array_equal(getattr(back.tracks, name), getattr(KEPT.tracks, name))
    np.testing.assert_allclose(back.tracks.existences, KEPT.tracks.existences, rtol=1e-7)
    np.testing.assert_allclose(back.tracks.sigmas, KEPT.tracks.sigmas, rtol=1e-7)
    for name in ("heights", "sigma_heights"):
        np.testing.assert_allclose(
            getattr(back.tracks, name), getattr(KEPT.tracks, name), rtol=1e-7
        )
    allowed = 5.1e-4 * np.prod(KEPT.tracks.sigmas[:, :2], axis=1)
    assert (np.abs(back.tracks.covariances_xy - KEPT.tracks.covariances_xy) <= allowed).all()
    np.testing.assert_allclose(
        back.detection_probabilities, KEPT.detection_probabilities, atol=5e-4
    )


def test_tracks_of_earlier_versions_have_no_heights() -> None:
    """They end with the correlation, and the first bytes say so."""
    whole = pack(KEPT)
    rows = len(KEPT.tracks)
    raw = zlib.decompress(whole[struct.calcsize("<4sIH") :])
    earlier = b"MVT2" + whole[4 : struct.calcsize("<4sIH")] + zlib.compress(raw[: -8 * rows])
    back = unpack(earlier).tracks
    assert np.isnan(back.heights).all()
    assert np.isnan(back.sigma_heights).all()
    np.testing.assert_array_equal(back.positions, KEPT.tracks.positions)
    assert (back.covariances_xy != 0.0).any()


@pytest.mark.parametrize("cameras", [0, 1, 12])
def test_nobody_comes_back_as_nobody(cameras: int) -> None:
    nobody = KeptTracks(Trajectories.empty(cameras), np.zeros((0, cameras)))
    back = unpack(pack(nobody))
    assert len(back.tracks) == 0
    assert back.tracks.seen.shape == back.detection_probabilities.shape == (0, cameras)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 40))
def test_gaps_and_odd_numbers_come_back(seed: int, people: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    whole = tracks(steps, people, seed=seed).tracks
    some = whole.take(np.flatnonzero(rng.random(len(whole)) < 0.6))
    odd = dataclasses.replace(
        some,
        positions=some.positions * 10.0 ** rng.integers(-300, 300, some.positions.shape),
        labels=rng.integers(-(2**63), 2**63 - 1, len(some)),
        components=np.arange(len(some)) - np.searchsorted(some.frames, some.frames),
    )
    back = unpack(pack(KeptTracks(odd, np.zeros(odd.seen.shape)))).tracks
    for name in EXACT:
        np.testing.assert_array_equal(getattr(back, name), getattr(odd, name))


def test_ten_thousand_runs_of_500_steps_and_10_people_take_at_most_2_gigabytes() -> None:
    assert 10_000 * len(pack(tracks(500, 10))) < 1.8e9  # the rest is for rows and half-empty pages


def test_a_flipped_bit_is_noticed_or_changes_nothing() -> None:
    data = pack(tracks(10, 2))
    noticed = 0
    rng = np.random.default_rng(0)
    for place in rng.choice(len(data), min(300, len(data)), replace=False).tolist():
        spoilt = bytearray(data)
        spoilt[place] ^= 1 << int(rng.integers(8))
        try:
            back = unpack(bytes(spoilt))
        except ValueError:
            noticed += 1
            continue
        assert pack(back) == data  # one of the few bits that fill up a byte
    assert noticed > 290

"""Where people come in, from where tracks begin and end."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.geometry.consistency.entrances import not_yet_there, suggest_entrances

FPS, STEPS = 20.0, 400

Piece = tuple[int, int, tuple[float, float], tuple[float, float]]
"""First and last step of a track, and where it begins and ends on the floor."""


def tracks(*pieces: Piece) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Steps, ids and places of people who walk straight."""
    frames, ids, places = [], [], []
    for person, (first, last, begin, end) in enumerate(pieces):
        steps = np.arange(first, last + 1)
        part = ((steps - first) / max(1, last - first))[:, None]
        frames.append(steps)
        ids.append(np.full(len(steps), person))
        flat = (1.0 - part) * np.array(begin) + part * np.array(end)
        places.append(np.column_stack([flat, np.full(len(steps), 0.9)]))
    return np.concatenate(frames), np.concatenate(ids), np.concatenate(places)


def found(*pieces: Piece) -> list[tuple[float, float, int]]:
    doors = suggest_entrances(*tracks(*pieces), steps=STEPS, fps=FPS)
    return [(round(d.position[0], 1), round(d.position[1], 1), d.tracks) for d in doors]


THERE_ALREADY = (0, 399, (-3.0, -3.0), (3.0, 3.0))


def test_two_doors_are_told_apart_and_the_busier_comes_first() -> None:
    assert found(
        (40, 399, (3.0, 0.2), (0.0, 0.0)),
        (90, 399, (3.0, -0.2), (0.0, 1.0)),
        (60, 300, (0.0, 4.0), (3.0, 0.0)),
        (100, 399, (0.0, 4.0), (1.0, 1.0)),
    ) == [(3.0, 0.0, 3), (0.0, 4.0, 2)]


def test_who_is_there_at_the_beginning_and_the_end_says_nothing() -> None:
    assert found(THERE_ALREADY, (0, 399, (2.0, 0.0), (-2.0, 0.0))) == []
    assert suggest_entrances(*tracks((0, 0, (0, 0), (0, 0))), steps=STEPS, fps=FPS) == []
    nothing = np.zeros(0, dtype=int)
    assert suggest_entrances(nothing, nothing, np.zeros((0, 3)), steps=STEPS, fps=FPS) == []


def test_a_track_that_is_lost_and_found_again_came_through_no_door() -> None:
    lost = (THERE_ALREADY, (0, 399, (3.0, -3.0), (-3.0, 3.0)), (0, 200, (-2.0, 0.0), (0.0, 0.0)))
    assert found(*lost, (220, 399, (0.3, 0.0), (2.0, 0.0))) == []
    assert found(*lost, (200, 399, (0.3, 0.0), (2.0, 0.0))) == [(0.2, 0.0, 2)], "both are there"
    assert found(*lost, (230, 399, (0.3, 0.0), (2.0, 0.0))) == [], "a second and a half"
    assert found(*lost, (231, 399, (0.3, 0.0), (2.0, 0.0))) == [(0.2, 0.0, 2)]
    farther = (*lost[:2], (0, 200, (-2.0, 0.0), (1.0, 0.0)))
    assert found(*farther, (220, 399, (2.5, 0.0), (2.0, 0.0))) == [], "a metre and a half"
    assert found(*farther, (220, 399, (2.6, 0.0), (2.0, 0.0))) == [(2.6, 0.0, 1)]
    # much later it is somebody else, who appears where one vanished: a door in the middle
    assert found(*lost, (300, 399, (0.3, 0.0), (2.0, 0.0))) == [(0.2, 0.0, 2)]


def test_one_beginning_alone_counts_at_the_edge_only() -> None:
    inside = (100, 399, (0.0, 0.0), (1.0, 0.0))
    assert found(THERE_ALREADY, (0, 399, (3.0, -3.0), (-3.0, 3.0)), inside) == []
    for x in (3.2, 2.25):
        edge = (100, 399, (x, 0.0), (1.0, 0.0))
        doors = found(THERE_ALREADY, (0, 399, (3.0, -3.0), (-3.0, 3.0)), edge)
        assert doors == [(round(x, 1), 0.0, 1)]


@pytest.mark.parametrize(("apart", "tracks"), [(1.0, [2]), (1.25, [1, 1])])
def test_a_door_is_as_wide_as_people_come_in_within_a_metre(
    apart: float, tracks: list[int]
) -> None:
    pieces = [(40, 399, (3.0, y), (0.0, 0.0)) for y in (0.0, apart)]
    assert [count for _, _, count in found(*pieces)] == tracks


@pytest.mark.parametrize(
    ("piece", "ends"),
    [
        ((10, 399, (3.2, 0.0), (1.0, 0.0)), 1),
        ((9, 399, (3.2, 0.0), (1.0, 0.0)), 0),
        ((0, 389, (1.0, 0.0), (3.2, 0.0)), 1),
        ((0, 390, (1.0, 0.0), (3.2, 0.0)), 0),
        ((100, 110, (3.2, 0.0), (3.2, 0.0)), 2),
        ((100, 109, (3.2, 0.0), (3.2, 0.0)), 0),
    ],
)
def test_half_a_second_is_long_enough(piece: Piece, ends: int) -> None:
    across = (0, 399, (3.0, -3.0), (-3.0, 3.0))
    assert found(THERE_ALREADY, across, piece) == ([(3.2, 0.0, ends)] if ends else [])


def test_short_tracks_are_accidents() -> None:
    assert found(THERE_ALREADY, (100, 105, (4.0, 0.0), (4.0, 0.0))) == []


def test_a_door_is_as_wide_as_its_beginnings_and_never_a_point() -> None:
    pieces = [(40 + 9 * k, 399, (3.0, y), (0.0, 0.0)) for k, y in enumerate((-0.4, 0.0, 0.4))]
    (door,) = suggest_entrances(*tracks(*pieces), steps=STEPS, fps=FPS)
    # (0.32 + 3 × 0.3²) / (3 + 3), and without any spread 3 × 0.3² / 6
    assert door.sigma[1] == pytest.approx(np.sqrt(0.59 / 6), abs=0.01)
    assert door.sigma[0] == pytest.approx(np.sqrt(0.27 / 6), abs=0.01)


def test_what_is_known_is_not_suggested_again() -> None:
    doors = suggest_entrances(
        *tracks((40, 399, (3.0, 0.0), (0.0, 0.0)), (40, 399, (-3.0, 0.0), (0.0, 0.0))),
        steps=STEPS,
        fps=FPS,
    )
    assert len(doors) == 2
    (left,) = not_yet_there(doors, [np.array([2.5, 0.3, 1.0])])
    assert left.position[0] == -3.0
    assert not_yet_there(doors, [np.array([2.0, 0.0, 1.0])]) == [left], "a metre away is the same"

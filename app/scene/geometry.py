"""Shapes of the 3D scene as arrays: ellipsoids, boxes, trails."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import gate_distance
from tracker.fusion.trajectories import Trajectories
from tracker.sequences.sequence import Room

DEFAULT_MASS = 0.9
"""Probability that an ellipsoid holds of its Gaussian."""

FUTURE_SECONDS = 2.0
"""How far back, and how far ahead, the way of a track is drawn."""

GRID_CELL = 0.5
"""Metres; twice as much where a room is so large that finer lines would run together."""

LARGE = 12.0
"""Metres, of the longer side of a large room."""

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_EDGES = np.array(
    [[a, b] for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1], dtype=np.int64
)
"""Pairs of corners that differ in one coordinate: the twelve edges of a box."""


def grid_cell(room: Room) -> float:
    """Metres between two lines of a room's floor."""
    longer = float((room.maximum - room.minimum)[:2].max())
    return GRID_CELL if longer <= LARGE else 2.0 * GRID_CELL


def mass_radius(mass: float, dimension: int = 3) -> float:
    """How many standard deviations hold a share of a Gaussian: the root of the χ² quantile.

    Raises:
        ValueError: If ``mass`` is not between 0 and 1.
    """
    if not 0.0 < mass < 1.0:
        raise ValueError(f"mass must be above 0 and below 1 (a probability), got {mass}")
    return float(np.sqrt(gate_distance(mass, dimension)))


def quaternions(rotations: Float[ndarray, "N 3 3"]) -> Float[ndarray, "N 4"]:
    """Unit quaternions w, x, y, z of proper rotation matrices."""
    from scipy.spatial.transform import Rotation  # once the 3D view is there

    return np.asarray(Rotation.from_matrix(rotations).as_quat(scalar_first=True))


def ellipsoids(
    covariances: Float[ndarray, "N 3 3"], mass: float = DEFAULT_MASS
) -> tuple[Float[ndarray, "N 4"], Float[ndarray, "N 3"]]:
    """Orientations and half axes of the ellipsoids that hold a share of each Gaussian.

    The surface is (x - m)ᵀ P⁻¹ (x - m) = χ²₃(mass), with the whole covariance P:
    its axes are the eigenvectors, as long as the roots of the eigenvalues.

    Args:
        covariances: P in squared metres, symmetric.
        mass: Probability inside.

    Returns:
        Unit quaternions w, x, y, z and half axes in metres; no rows for no rows.
    """
    if len(covariances) == 0:
        return np.zeros((0, 4)), np.zeros((0, 3))
    variances, axes = np.linalg.eigh(covariances)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]  # a rotation, not a mirror
    return quaternions(axes), np.sqrt(np.maximum(variances, 0.0)) * mass_radius(mass)


def surfaces(
    means: Float[ndarray, "N 3"], wxyzs: Float[ndarray, "N 4"], axes: Float[ndarray, "N 3"]
) -> Float[ndarray, "M 3"]:
    """Points all over ellipsoids, 42 of each.

    Args:
        means: Their middles.
        wxyzs: Unit quaternions of their turns.
        axes: Half axes.
    """
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(wxyzs, scalar_first=True).as_matrix()
    local = icosphere(1)[0][None] * axes[:, None]
    return np.asarray(means[:, None] + np.einsum("nij,nkj->nki", turns, local)).reshape(-1, 3)


@cache
def icosphere(subdivisions: int = 2) -> tuple[Float[ndarray, "V 3"], Int[ndarray, "F 3"]]:
    """Vertices on the unit sphere and triangles, from a divided icosahedron."""
    import trimesh  # a third of a second, once the page is there

    ball = trimesh.creation.icosphere(subdivisions)
    return np.asarray(ball.vertices), np.asarray(ball.faces)


def unit_cube() -> tuple[Float[ndarray, "8 3"], Int[ndarray, "12 3"]]:
    """The cube from -1 to 1 as vertices and outward triangles."""
    quads = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    )
    return _CORNERS.copy(), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


@cache
def figure(sides: int = 20) -> tuple[Float[ndarray, "V 3"], Int[ndarray, "F 3"]]:
    """A standing body as a surface of revolution: z from 0 on the floor to 1, radius up to 1."""
    profile = np.array(
        [
            (0.0, 0.0), (0.30, 0.0), (0.42, 0.06), (0.50, 0.25), (0.62, 0.45), (0.72, 0.60),
            (0.78, 0.72), (0.70, 0.80), (0.34, 0.845), (0.30, 0.86), (0.42, 0.89), (0.46, 0.93),
            (0.38, 0.975), (0.20, 0.995), (0.0, 1.0),
        ]
    )  # fmt: skip
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = np.concatenate(
        [
            profile[:, None, :1] * circle[None],
            np.broadcast_to(profile[:, None, 1:], (len(profile), sides, 1)),
        ],
        axis=2,
    )
    here = np.arange((len(profile) - 1) * sides).reshape(-1, sides)
    beside = np.roll(here, -1, axis=1)
    triangles = [(here, beside, beside + sides), (here, beside + sides, here + sides)]
    faces = np.concatenate([np.stack(t, axis=2).reshape(-1, 3) for t in triangles])
    return rings.reshape(-1, 3), faces


@cache
def disc(sides: int = 32) -> tuple[Float[ndarray, "V 3"], Int[ndarray, "F 3"]]:
    """The unit disc on the floor, looking up."""
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    edge = np.arange(1, sides + 1)
    faces = np.stack([np.zeros(sides, dtype=np.int64), edge, np.roll(edge, -1)], axis=1)
    return np.concatenate([np.zeros((1, 3)), rim]), faces


def box_corners(low: Float[ndarray, " 3"], high: Float[ndarray, " 3"]) -> Float[ndarray, "8 3"]:
    """The eight corners of a volume."""
    return np.asarray((low + high) / 2.0 + _CORNERS * (high - low) / 2.0)


def box_edges(
    centres: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
) -> Float[ndarray, "N 12 2 3"]:
    """The twelve edges of upright boxes as segments."""
    centres = np.asarray(centres, dtype=float).reshape(-1, 3)
    corners = centres[:, None, :] + _CORNERS * half_extents
    return np.asarray(corners[:, _EDGES])


def dashes(segments: Float[ndarray, "N 2 3"], length: float) -> Float[ndarray, "M 2 3"]:
    """Segments cut into dashes of about ``length`` metres with gaps of two thirds of it.

    Each begins and ends with a dash, so that corners stay closed.
    """
    if len(segments) == 0:
        return np.zeros((0, 2, 3))
    start, step = segments[:, 0], segments[:, 1] - segments[:, 0]
    whole = np.linalg.norm(step, axis=1)
    # n dashes and n - 1 gaps fill the segment
    counts = np.maximum(1, np.rint((whole / length + 2.0 / 3.0) / (5.0 / 3.0))).astype(np.int64)
    owner = np.repeat(np.arange(len(segments)), counts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    dash = 1.0 / (counts + (counts - 1) * 2.0 / 3.0)
    begin = (place * dash[owner] * 5.0 / 3.0)[:, None]
    end = begin + dash[owner][:, None]
    return np.stack([start[owner] + begin * step[owner], start[owner] + end * step[owner]], axis=1)


def floor_grid(
    low: Float[ndarray, " 2"], high: Float[ndarray, " 2"], height: float, cell: float
) -> tuple[Float[ndarray, "A 2 3"], Float[ndarray, "B 2 3"]]:
    """Lines of a grid on the floor, at multiples of the cell: the fine ones and every second.

    Args:
        low: Least x and y that it must reach.
        high: Greatest x and y.
        height: z of the floor.
        cell: Metres between two lines.
    """
    first = np.floor(np.asarray(low) / cell / 2.0).astype(int) * 2
    last = np.ceil(np.asarray(high) / cell / 2.0).astype(int) * 2
    lines: dict[bool, list[list[list[float]]]] = {False: [], True: []}
    (x0, y0), (x1, y1) = (first * cell).tolist(), (last * cell).tolist()
    for i in range(first[0], last[0] + 1):
        lines[i % 2 == 0].append([[i * cell, y0, height], [i * cell, y1, height]])
    for i in range(first[1], last[1] + 1):
        lines[i % 2 == 0].append([[x0, i * cell, height], [x1, i * cell, height]])
    return np.array(lines[False]).reshape(-1, 2, 3), np.array(lines[True]).reshape(-1, 2, 3)


def pieces(segments: Float[ndarray, "N 2 3"], length: float) -> Float[ndarray, "M 2 3"]:
    """Segments cut into pieces of about a length, so that a line's colour can change along it."""
    if len(segments) == 0:
        return np.zeros((0, 2, 3))
    start, step = segments[:, 0], segments[:, 1] - segments[:, 0]
    counts = np.maximum(1, np.rint(np.linalg.norm(step, axis=1) / length)).astype(np.int64)
    owner = np.repeat(np.arange(len(segments)), counts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = np.stack([place, place + 1], axis=1) / counts[owner][:, None]
    return np.asarray(start[owner][:, None] + ends[..., None] * step[owner][:, None])


def distance_beside(
    points: Float[ndarray, "*N 2"], low: Float[ndarray, " 2"], high: Float[ndarray, " 2"]
) -> Float[ndarray, "*N"]:
    """How far points lie beside a rectangle; 0 inside."""
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.asarray(np.linalg.norm(outside, axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class Trails:
    """Segments of the way of each track, oldest first."""

    segments: Float[ndarray, "S 2 3"]
    ids: Int[ndarray, " S"]
    ages: Float[ndarray, "S 2"]
    """Seconds before the shown step, of both ends; negative after it."""


def trails(
    tracks: Trajectories,
    step: int,
    seconds: float,
    fps: float,
    drop: float = 0.0,
    ahead: float = 0.0,
) -> Trails:
    """The way of every track around a step; a gap where no camera saw it.

    Args:
        tracks: Rows sorted by step.
        step: The shown one.
        seconds: How far back.
        fps: Steps a second.
        drop: Metres below the position, for instance half a person's height.
        ahead: Seconds after the step; 0 draws nothing that is still to come.
    """
    ends = [step - round(seconds * fps), step + round(ahead * fps) + 1]
    first, last = np.searchsorted(tracks.frames, ends)
    rows = np.arange(first, last)
    order = rows[np.lexsort((tracks.frames[rows], tracks.ids[rows]))]
    frames, ids = tracks.frames[order], tracks.ids[order]
    seen: Bool[ndarray, " M"] = np.asarray(tracks.seen[order].any(axis=1))
    joined = (np.diff(ids) == 0) & (np.diff(frames) == 1) & (seen[1:] | seen[:-1])
    starts = np.flatnonzero(joined)
    positions = tracks.positions[order] - np.array([0.0, 0.0, drop])
    ages = (step - frames) / fps
    return Trails(
        segments=np.stack([positions[starts], positions[starts + 1]], axis=1),
        ids=ids[starts],
        ages=np.stack([ages[starts], ages[starts + 1]], axis=1),
    )

"""Truth brought into the world of the cameras, people numbered across files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.io.checks.truth import contradicts, share_in_boxes
from tracker.io.conventions.reading import Reading, levelled, upright
from tracker.io.read.pieces import GRIDS, METRES, TruthPiece, Unit
from tracker.sequences.sequence import Detections, GroundTruth
from tracker.sequences.tables import covered_steps, regular_gap

_MOST_INSIDE = 0.5
"""Share of places in boxes that another unit or another turn must reach to be believed."""

_CLEARLY = 0.05
"""By how much more of the places must lie in boxes for another reading than the plain one."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The recording into which truth is brought."""

    cameras: Sequence[Camera]
    """In metres, z up."""
    detections: Sequence[Detections | None]
    """Of each camera, by step."""
    views: Sequence[str | None]
    """What each camera is called in the annotations whose boxes it has; None without."""
    reading: Reading
    """Of the calibration."""
    frames: int
    """Steps of the recording; what is beyond is left out."""
    floor: float
    """z of the floor, metres."""
    middle: float
    """z of the middle of a person, metres, for places on the floor."""
    first_index: int | None
    """Number of the first frame, where it is known better."""

    def share(self, steps: Int[ndarray, " G"], places: Float[ndarray, "G 3"]) -> float:
        """The share of places in boxes."""
        return share_in_boxes(steps, places, self.cameras, self.detections)

    def contradict(
        self, share: float, steps: Int[ndarray, " G"], places: Float[ndarray, "G 3"]
    ) -> bool:
        """Whether there are boxes, and places are elsewhere."""
        there = any(each is not None for each in self.detections)
        return there and contradicts(share, steps, places, self.cameras, self.detections)


def settle_truth(
    pieces: Sequence[TruthPiece], around: Surroundings, found: list[tuple[str, str]]
) -> GroundTruth | None:
    """All truth in metres, in the cameras' world.

    A file may have another axis up than the calibration, and be turned about it by a quarter:
    that is taken in which most places lie in boxes.

    Args:
        pieces: As their files have them; several of one person each become several people.
        around: The recording.
        found: What was found out is added.

    Returns:
        None where there is no truth.
    """
    pieces = [piece for piece in pieces if len(piece.frames)]
    if not pieces:
        return None
    steps, ids, places, valid = [], [], [], []
    beyond = 0
    for piece in pieces:
        first = piece.first_index if around.first_index is None else around.first_index
        own = piece.frames - (first if first is not None else int(piece.frames.min() > 0))
        keep = (own >= 0) & (own < around.frames)
        # what the recording will have is compared, as its check compares it
        compared = keep if keep.any() else np.ones(len(own), dtype=bool)
        moved, sentences = _placed(piece, around, own, compared)
        found += [("truth", words) for words in sentences]
        beyond += int((~keep).sum())
        steps.append(own[keep])
        ids.append(piece.ids[keep])
        places.append(moved[keep])
        valid.append(
            np.ones(int(keep.sum()), dtype=bool) if piece.valid is None else piece.valid[keep]
        )
    if _overlap(steps, ids):  # a file a person, each with its own numbers
        ids = [np.full(len(own), number) for number, own in enumerate(ids, 1)]
    all_steps, all_ids = np.concatenate(steps), np.concatenate(ids)
    if beyond:
        found.append(("truth", f"{beyond} rows are of steps that the recording does not have"))
    all_ids = all_ids - min(0, int(all_ids.min(initial=0)))
    order = np.lexsort([all_ids, all_steps])
    pairs = np.column_stack([all_steps, all_ids])[order]
    order = order[np.concatenate([[True], (np.diff(pairs, axis=0) != 0).any(axis=1)])]
    known = covered_steps(all_steps, around.frames)
    if known is not None:
        gap = in_gaps(regular_gap(all_steps))
        found.append(("truth", f"knows {gap}; others are not scored"))
    return GroundTruth(
        all_steps[order],
        all_ids[order],
        np.concatenate(places)[order],
        np.concatenate(valid)[order],
        known,
    )


def _placed(
    piece: TruthPiece,
    around: Surroundings,
    steps: Int[ndarray, " G"],
    compared: Bool[ndarray, " G"],
) -> tuple[Float[ndarray, "G 3"], list[str]]:
    """The places of a file in the cameras' world, and sentences on how they are taken.

    Args:
        piece: As the file has them.
        around: The recording.
        steps: Of each place.
        compared: Which places are compared with boxes.
    """
    given = piece.positions.copy()
    on_floor = ~np.isfinite(given[:, 2])
    given[on_floor, 2] = 0.0
    candidates: list[tuple[str, Float[ndarray, "G 3"]]] = []
    for grid in GRIDS if piece.cells is not None else (None,):
        if grid is not None and piece.cells is not None:
            given = np.column_stack([grid.places(piece.cells), np.zeros(len(given))])
        for factor, turn, how in _ways(piece, around.reading):
            moved = factor * given @ turn.T
            moved[on_floor, 2] = around.middle
            candidates.append(
                (how if grid is None else f"taken with the grid of {grid.name}", moved)
            )
    scores = [around.share(steps[compared], moved[compared]) for _, moved in candidates]
    if piece.cells is not None and max(scores) < _MOST_INSIDE:
        feet = feet_on_floor(piece, around.views, around.cameras, around.floor)
        inferred = infer_grid(piece.cells, feet)
        if inferred is not None:
            moved = np.column_stack([inferred[0], np.full(len(given), around.middle)])
            how = f"taken with a grid of {inferred[1]}, by where the boxes stand,"
            candidates.append((how, moved))
            scores.append(around.share(steps[compared], moved[compared]))
    best = int(np.argmax(scores))
    if scores[best] < max(scores[0] + _CLEARLY, _MOST_INSIDE):
        best = 0
    how, moved = candidates[best]
    name = piece.source.name
    sentences = [piece.left_out] if piece.left_out else []
    if around.contradict(scores[best], steps[compared], moved[compared]):
        sentences.append(
            f"{name}: {100 * scores[best]:.0f} % of its places lie in boxes; its origin, axes, "
            "grid, unit or frame numbers may be others than the calibration's and the boxes'"
        )
    if best:
        sentences.append(
            f"{name}: {how} so that {100 * scores[best]:.0f} % of its places lie in boxes "
            f"({100 * scores[0]:.0f} % as it is)"
        )
    return moved, sentences


def in_gaps(gap: int) -> str:
    """Every so many frames, in words."""
    names = {2: "second", 3: "third", 4: "fourth", 5: "fifth", 10: "tenth"}
    return f"every {names.get(gap, f'{gap}th')} frame"


def _ways(
    piece: TruthPiece, reading: Reading
) -> Iterator[tuple[float, Float[ndarray, "3 3"], str]]:
    """Metres in a unit, rotation into the cameras' world, and both in words, the plain reading
    first."""
    same = piece.up in (None, reading.up)
    own = levelled(reading) if same else upright(piece.up or reading.up)
    units: tuple[Unit, ...] = (
        (piece.unit,) if piece.unit else (reading.unit, *(u for u in METRES if u != reading.unit))
    )
    for unit in units:
        for turn in range(4 if not same or piece.unit is None else 1):
            angle = turn * np.pi / 2.0
            c, s = round(np.cos(angle)), round(np.sin(angle))
            yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            words = [f"read in {unit}"] if unit != units[0] else []
            words += [f"turned by {90 * turn}°"] if turn else []
            yield METRES[unit], yaw @ own, " and ".join(words)


def _overlap(steps: Sequence[ndarray], ids: Sequence[ndarray]) -> bool:
    pairs = np.column_stack([np.concatenate(steps), np.concatenate(ids)])
    return len(np.unique(pairs, axis=0)) < len(pairs)


_FEWEST = 50
"""Rows with feet from which a grid is inferred."""

_SAMPLED = 1000
"""Rows of which the grid is inferred, at most."""

_COMPARED = 200
"""Rows of these by which counts of columns are compared."""

_MOST_COLUMNS = 10_000

_LARGEST_CELL = 1.0
"""Metres."""

_USUAL = (1.0, 2.0, 2.5, 4.0, 5.0)
"""The first digits of usual sizes."""

_ROUNDING = 0.05
"""Relative error of a cell's size that is taken for the boxes' error."""

_LARGEST_ERROR = 0.25
"""Median distance of the feet from the middles of their cells, metres."""


def feet_on_floor(
    piece: TruthPiece, views: Sequence[str | None], cameras: Sequence[Camera], floor: float
) -> Float[ndarray, "G 2"]:
    """Return where the annotated boxes of each row stand, the median over the cameras.

    Args:
        piece: The truth, with the feet of its rows in the pictures.
        views: The name of each camera in the file; None for one that it does not have.
        cameras: The cameras in metres, z up.
        floor: z of the floor, metres.

    Returns:
        x and y in metres; NaN for a row that no camera sees.
    """
    found = np.full((len(cameras), len(piece.frames), 2), np.nan)
    for place, view, camera in zip(found, views, cameras, strict=True):
        pixels = piece.feet.get(view or "", np.zeros((0, 2)))
        rows = np.flatnonzero(np.isfinite(pixels).all(axis=1))
        rays = camera.back_project(pixels[rows])
        down = rays[:, 2] < 0.0  # the others never meet the floor
        along = (floor - camera.centre[2]) / rays[down, 2]
        place[rows[down]] = camera.centre[:2] + along[:, None] * rays[down, :2]
    seen = np.isfinite(found).any(axis=(0, 2))
    result = np.full((len(piece.frames), 2), np.nan)
    result[seen] = np.nanmedian(found[:, seen], axis=0)
    return result


def infer_grid(
    cells: Int[ndarray, " G"], feet: Float[ndarray, "G 2"]
) -> tuple[Float[ndarray, "G 2"], str] | None:
    """Infer the grid that explains where the boxes stand.

    Cell i of a grid of W columns lies at x = x₀ + s (i mod W), y = y₀ + s ⌊i / W⌋, or with x and y
    exchanged. One coordinate of the feet grows with i by s / W a cell; of all W that one is taken
    with which the other coordinate follows from i mod W.

    Args:
        cells: The number of the cell of each row.
        feet: Where the row's boxes stand, metres; NaN for none.

    Returns:
        The place of each row in metres, and a phrase about the grid; None if no grid fits.
    """
    known = np.flatnonzero(np.isfinite(feet).all(axis=1))
    if len(known) < _FEWEST:
        return None
    known = known[np.linspace(0, len(known) - 1, min(_SAMPLED, len(known))).astype(int)]
    best: tuple[float, Float[ndarray, "G 2"], str] | None = None
    for slow in (1, 0):
        fast = 1 - slow
        slope = _slope(cells[known].astype(float), feet[known, slow])
        for sign in (1, -1):
            columns = _columns(cells[known], feet[known, fast], sign * abs(slope))
            cell = _rounded(abs(slope) * columns)
            places = np.empty((len(cells), 2))
            places[:, fast] = sign * cell * (cells % columns)
            places[:, slow] = np.sign(slope) * cell * (cells // columns)
            origin = np.median(feet[known] - places[known], axis=0)
            origin = np.round(origin / cell) * cell
            places += origin
            error = float(np.median(np.linalg.norm(feet[known] - places[known], axis=1)))
            words = (
                f"{columns} columns of {100.0 * cell:.3g} cm along {'xy'[fast]} from "
                f"({origin[0]:.3g}, {origin[1]:.3g}) m"
            )
            if error < _LARGEST_ERROR and (best is None or error < best[0]):
                best = error, places, words
    return None if best is None else best[1:]


def _slope(cells: Float[ndarray, " N"], along: Float[ndarray, " N"]) -> float:
    """Return metres a cell number, by least squares without the worst tenth of the rows."""
    keep = np.ones(len(cells), dtype=bool)
    slope = 0.0
    for _ in range(3):
        slope, at_zero = np.polyfit(cells[keep], along[keep], 1)
        off = np.abs(along - at_zero - slope * cells)
        keep = off <= np.quantile(off, 0.9)
    return float(slope) or 1.0


def _columns(cells: Int[ndarray, " N"], along: Float[ndarray, " N"], slope: float) -> int:
    """Return the count of columns with which the other coordinate scatters least."""
    some = slice(None, None, max(1, len(cells) // _COMPARED))
    counts = np.arange(2, min(_MOST_COLUMNS, 3 + int(_LARGEST_CELL / abs(slope))))
    scatters = []
    for few in np.array_split(counts[:, None], len(counts) // _COMPARED + 1):
        off = along[some] - slope * few * (cells[some] % few)
        scatters.append(np.median(np.abs(off - np.median(off, axis=1)[:, None]), axis=1))
    return int(counts[np.argmin(np.concatenate(scatters))])


def _rounded(cell: float) -> float:
    """Return the usual size that is nearest, if it is that but for the error of the boxes."""
    usual = np.outer(_USUAL, 10.0 ** np.arange(-3.0, 1.0)).ravel()
    nearest = float(usual[np.argmin(np.abs(np.log(usual / cell)))])
    return nearest if abs(nearest / cell - 1.0) < _ROUNDING else cell

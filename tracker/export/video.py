"""The MP4 (H.264) of a run: the cameras in a mosaic, the room from above, the tracks' lanes.

The video has one frame for each step; each is decoded, drawn and encoded before the next.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from collections.abc import Sequence as Many
from contextlib import ExitStack, closing
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.export.exported_run import ExportedRun, Options
from tracker.export.palette import rgb
from tracker.sequences.pictures.frames import FrameReader, Picture

Bgr = tuple[int, int, int]

GROUND: Bgr = (24, 24, 24)
PANE: Bgr = (32, 32, 32)
LINE: Bgr = (90, 90, 90)
WORDS: Bgr = (200, 200, 200)
BLACK: Bgr = (0, 0, 0)

WIDEST = 1920
"""Largest width of the whole picture, pixels."""

LARGEST_CELL = 640
"""Largest width of a camera's cell, pixels."""

TRAIL_SECONDS = 3.0
"""Time before a step whose part of the track is drawn, seconds."""

LANE = 12
"""Height of a track's lane, pixels."""

MOST_LANES = 24
"""Largest number of lanes, those of the longest tracks; more would leave too little height for the
cameras."""

_MARGIN = 6
"""Space above and below the lanes, pixels."""

_FONT = cv2.FONT_HERSHEY_SIMPLEX

_QUALITY = {"preset": "veryfast", "crf": "20"}
"""The options of the encoder libx264."""

_FINEST_RATE = 1000
"""Largest denominator of the frame rate, which is encoded as a fraction."""


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write the video; its frame k shows step ``options.first`` + k.

    Raises:
        ValueError: If the range of steps is empty, or the speed is out of range.
        Stopped: If the caller cancelled the export.
    """
    import av

    first = options.first
    last = run.steps - 1 if options.last is None else min(options.last, run.steps - 1)
    if not 0 <= first <= last:
        raise ValueError(
            f"a video from step {first} to {last}: expected two of 0 … {run.steps - 1}, "
            "the first not after the last"
        )
    if not 0.01 <= options.speed <= 100.0:
        raise ValueError(f"a video at speed {options.speed:g}: expected 0.01 … 100")
    mosaic = Mosaic(run)
    total = last - first + 1
    rate = Fraction(run.sequence.fps * options.speed).limit_denominator(_FINEST_RATE)
    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=rate, options=_QUALITY)
        stream.width, stream.height = mosaic.size
        stream.pix_fmt = "yuv420p"
        stream.codec_context.thread_type = "AUTO"
        with ExitStack() as stack:
            reader = stack.enter_context(FrameReader(run.sequence))
            walks = [
                stack.enter_context(closing(_walk(reader, camera, first)))
                for camera in range(len(run.sequence.views))
            ]
            for step in range(first, last + 1):
                options.at(step - first, total)
                drawn = mosaic.draw(step, [next(walk, None) for walk in walks])
                file.mux(stream.encode(av.VideoFrame.from_ndarray(drawn, format="bgr24")))
        file.mux(stream.encode())
    options.at(total, total)


def _walk(reader: FrameReader, camera: int, first: int) -> Generator[Picture | None, None, None]:
    """Yield the pictures of the camera with an index from a step on; None for missing ones."""
    yield from reader.iterate(camera, first)


def colour(number: int) -> Bgr:
    """Return the colour of the track with an id: blue, green, red in 0 … 255."""
    red, green, blue = rgb(number)
    return blue, green, red


class Mosaic:
    """The frames of a run's video."""

    def __init__(self, run: ExportedRun) -> None:
        """Lay out the cells, and draw the static parts: the room and the lanes."""
        self._run = run
        sequence, tracks = run.sequence, run.tracks
        cells = len(sequence.views) + 1
        self._columns = math.ceil(math.sqrt(cells)) if cells > 3 else cells
        rows = -(-cells // self._columns)
        largest = max((c.image_size for c in sequence.cameras), default=(360, 288))
        width = min(LARGEST_CELL, largest[0], WIDEST // self._columns)
        self._cell = (_even(width), _even(width * largest[1] / largest[0]))
        self._lanes = _lanes_of(run)
        lanes = LANE * len(self._lanes) + 2 * _MARGIN
        self.size = (self._cell[0] * self._columns, _even(self._cell[1] * rows + lanes))
        self._trail = round(TRAIL_SECONDS * sequence.fps)
        feet = tracks.positions - [0.0, 0.0, sequence.target_half_extents[2]]
        self._feet = []
        for camera in sequence.cameras:
            pixels, in_front = camera.project(feet)
            self._feet.append(np.where(in_front[:, None], pixels, np.nan))
        self._rows_of = {n: np.flatnonzero(tracks.ids == n) for n in run.ids}
        self._still = self._draw_still()

    def draw(self, step: int, pictures: Many[ndarray | None]) -> UInt8[ndarray, "h w 3"]:
        """Draw one step.

        Args:
            step: The step, 0-based.
            pictures: The picture of each camera, BGR; None for a missing one.
        """
        canvas = self._still.copy()
        for index, picture in enumerate(pictures):
            self._draw_camera(self._at(canvas, index), index, step, picture)
        self._draw_room(self._at(canvas, len(pictures)), step)
        width, height = self.size
        x = round((step + 0.5) / self._run.sequence.frames * width)
        top = height - LANE * len(self._lanes) - 2 * _MARGIN
        cv2.line(canvas, (x, top), (x, height - 1), WORDS, 1)
        seconds = step * self._run.sequence.step_time
        _write(canvas, f"step {step}  {seconds:.2f} s", (width - 170, self._cell[1] - 8))
        return canvas

    def _at(self, canvas: ndarray, index: int) -> ndarray:
        """Return the part of the canvas (a view) of the cell with an index."""
        width, height = self._cell
        row, column = divmod(index, self._columns)
        cell: ndarray = canvas[
            row * height : (row + 1) * height, column * width : (column + 1) * width
        ]
        return cell

    def _draw_camera(self, cell: ndarray, index: int, step: int, picture: ndarray | None) -> None:
        """Draw the picture of the camera with an index, with the boxes and trails of its tracks."""
        camera = self._run.sequence.cameras[index]
        height, width = cell.shape[:2]
        scale = min(width / camera.image_size[0], height / camera.image_size[1])
        size = (round(camera.image_size[0] * scale), round(camera.image_size[1] * scale))
        if picture is None:
            _write(cell, "no picture", (8, height - 10))
        else:
            small = picture
            if picture.shape[1::-1] != size:
                small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            cell[: size[1], : size[0]] = small
        tracks = self._run.tracks
        pixels, visible = self._run.boxes[index]
        rows = tracks.at(step)
        for row in range(rows.start, rows.stop):
            number = int(tracks.ids[row])
            self._draw_trail(cell, self._feet[index] * scale, number, step)
            if not visible[row]:
                continue
            left, top, wide, high = (pixels[row] * scale).round().astype(int).tolist()
            seen = bool(tracks.seen[row, index])
            corner = (left + wide, top + high)
            cv2.rectangle(cell, (left, top), corner, BLACK, 3 if seen else 2)
            cv2.rectangle(cell, (left, top), corner, colour(number), 2 if seen else 1)
            _tag(cell, number, (left, top))
        _write(cell, camera.name, (6, 14))

    def _draw_trail(
        self, cell: ndarray, points: Float[ndarray, "N 2"], number: int, step: int
    ) -> None:
        """Draw the last seconds of a track.

        Args:
            cell: The cell.
            points: The pixel in the cell of each of the N rows of all tracks; NaN if there is none.
            number: The id of the track.
            step: The last step that is drawn.
        """
        rows = self._rows_of[number]
        frames = self._run.tracks.frames[rows]
        first, last = np.searchsorted(frames, [step - self._trail, step + 1])
        way = points[rows[first:last]]
        way = way[np.isfinite(way).all(axis=1)]
        if len(way) > 1:
            line = np.clip(way, -1e4, 1e4).round().astype(np.int32)[:, None]
            cv2.polylines(cell, [line], False, colour(number), 1, cv2.LINE_AA)

    def _draw_room(self, cell: ndarray, step: int) -> None:
        """Draw the tracks of a step into the room seen from above."""
        tracks = self._run.tracks
        rows = tracks.at(step)
        points = self._above(tracks.positions[:, :2])
        for row in range(rows.start, rows.stop):
            number = int(tracks.ids[row])
            self._draw_trail(cell, points, number, step)
            place = tuple(points[row].round().astype(int).tolist())
            cv2.circle(cell, place, 5, colour(number), -1, cv2.LINE_AA)
            _write(cell, str(number), (place[0] + 7, place[1] + 4))

    def _above(self, points: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        """Map world x, y in metres to pixels of the room's cell, with y pointing up."""
        room = self._run.sequence.room
        cameras = np.array([c.centre[:2] for c in self._run.sequence.cameras]).reshape(-1, 2)
        size = room.maximum[:2] - room.minimum[:2]
        low = np.minimum(room.minimum[:2] - 0.1 * size, np.min(cameras, axis=0, initial=np.inf))
        high = np.maximum(room.maximum[:2] + 0.1 * size, np.max(cameras, axis=0, initial=-np.inf))
        low = np.maximum(low, room.minimum[:2] - size)  # a camera far away leaves the room visible
        high = np.minimum(high, room.maximum[:2] + size)
        width, height = self._cell
        scale = min((width - 24) / (high[0] - low[0]), (height - 24) / (high[1] - low[1]))
        middle = (low + high) / 2.0
        pixels: ndarray = (points - middle) * [scale, -scale] + [width / 2.0, height / 2.0]
        return pixels

    def _draw_still(self) -> UInt8[ndarray, "h w 3"]:
        """Draw all that is the same at every step: the room, the cameras in it, and the lanes."""
        width, height = self.size
        canvas = np.full((height, width, 3), GROUND, dtype=np.uint8)
        sequence = self._run.sequence
        cell = self._at(canvas, len(sequence.views))
        cell[:] = PANE
        ends = self._above(np.array([sequence.room.minimum[:2], sequence.room.maximum[:2]]))
        (left, low), (right, high) = ends.round().astype(int).tolist()
        cv2.rectangle(cell, (left, high), (right, low), LINE, 1)
        for camera in sequence.cameras:
            place = self._above(camera.centre[None, :2])[0].round().astype(int).tolist()
            cv2.drawMarker(cell, tuple(place), WORDS, cv2.MARKER_TRIANGLE_UP, 8)
        _write(cell, "from above", (6, 14))
        top = height - LANE * len(self._lanes) - _MARGIN
        for index, (number, spans) in enumerate(self._lanes):
            y = top + LANE * index + LANE // 2
            for first, last in spans:
                begin, end = (round(s / sequence.frames * width) for s in (first, last + 1))
                cv2.rectangle(
                    canvas, (begin, y - 3), (max(begin, end - 1), y + 2), colour(number), -1
                )
        return canvas


def _lanes_of(run: ExportedRun) -> list[tuple[int, list[tuple[int, int]]]]:
    """Return the ids of the longest tracks, ascending, each with the first and the last step of
    every part without a gap."""
    tracks = run.tracks
    longest = sorted(run.ids, key=lambda n: -int((tracks.ids == n).sum()))[:MOST_LANES]
    lanes = []
    for number in sorted(longest):
        frames = tracks.frames[tracks.ids == number]
        parts = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
        lanes.append((number, [(int(part[0]), int(part[-1])) for part in parts]))
    return lanes


def _tag(cell: ndarray, number: int, place: tuple[int, int]) -> None:
    """Draw a track's id above a place, pixels."""
    text = str(number)
    width = 8 + 8 * len(text)
    left, top = place[0], max(0, place[1] - 15)
    cv2.rectangle(cell, (left, top), (left + width, top + 14), colour(number), -1)
    cv2.putText(cell, text, (left + 4, top + 11), _FONT, 0.42, BLACK, 1, cv2.LINE_AA)


def _write(cell: ndarray, text: str, place: tuple[int, int]) -> None:
    """Draw a text, the lower left corner of which is a place in pixels."""
    plain = text.encode("ascii", "replace").decode()  # the font has no other letters
    cv2.putText(cell, plain, place, _FONT, 0.4, BLACK, 3, cv2.LINE_AA)
    cv2.putText(cell, plain, place, _FONT, 0.4, WORDS, 1, cv2.LINE_AA)


def _even(value: float) -> int:
    """Round to an even number of pixels, since chroma has half the resolution in the video."""
    return max(2, round(value / 2.0) * 2)

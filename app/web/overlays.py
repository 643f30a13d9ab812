"""What is laid over a picture: the grid on the floor, the foreground, likelihood maps."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from typing import Annotated

import cv2
import numpy as np
from fastapi import APIRouter, Response
from jaxtyping import Float, UInt8
from numpy import ndarray

from app.errors import sentence
from app.messages import Model
from app.scene.geometry import grid_cell
from app.state.snapshot import Snapshot
from app.web.dependencies import ERRORS, Bench, a_file, of_app, opened
from app.web.pictures import Kept, checked, missing, picture_of, png
from tracker.geometry.camera import Camera
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Room, Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour.templates import likelihood_map, read_templates
from tracker.single_view.pictures.background import unpack
from tracker.single_view.pictures.colour import ColourModel

Line = list[tuple[float, float]]
"""Points one after the other, x and y in pixels of the camera's picture."""


class CameraFloor(Model):
    """In the picture of one camera, bent as its lens bends what is straight."""

    lines: list[Line]
    """Of the grid; what the camera does not see is left out."""
    edges: list[Line]
    """Of the room's floor."""


class Floor(Model):
    """Of the open sequence's room."""

    cell: float
    """Metres between two lines."""
    height: float
    """z of the floor, metres."""
    cameras: list[CameraFloor]


PIECES = 25
"""A cell is projected at so many places of each of its lines: a lens bends them."""
NEAR = 0.3
"""Metres in front of a camera below which nothing is drawn."""
OFF = 0.5
"""How far beside its picture a line goes on, of the picture's size."""
TOLERANCE = 0.25
"""Pixels by which a line that is told may differ from the line that is meant."""


def floor_of(sequence: Sequence) -> Floor:
    """The grid of the room's floor in the picture of every camera.

    Each line is z = the floor, at whole multiples of the cell in world metres, from one edge of
    the room to the other, projected through pose, intrinsics and lens.
    """
    room, cell = sequence.room, grid_cell(sequence.room)
    grid, edges = _grid(room, cell), _edges(room, cell)
    return Floor(
        cell=cell,
        height=float(room.minimum[2]),
        cameras=[
            CameraFloor(
                lines=[line for way in grid for line in _seen(camera, way)],
                edges=[line for way in edges for line in _seen(camera, way)],
            )
            for camera in sequence.cameras
        ],
    )


def _grid(room: Room, cell: float) -> list[Float[ndarray, "P 3"]]:
    low, high = room.minimum, room.maximum
    ways = []
    for axis in (0, 1):
        first, last = np.floor(low[axis] / cell) + 1, np.ceil(high[axis] / cell) - 1
        for number in np.arange(first, last + 1):
            ends = np.array([low, high])
            ends[:, axis], ends[:, 2] = number * cell, low[2]
            ways.append(_way(ends[0], ends[1], cell))
    return ways


def _edges(room: Room, cell: float) -> list[Float[ndarray, "P 3"]]:
    (x0, y0, z), (x1, y1, _) = room.minimum, room.maximum
    corners = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return [_way(corners[i], corners[(i + 1) % 4], cell) for i in range(4)]


def _way(
    start: Float[ndarray, " 3"], end: Float[ndarray, " 3"], cell: float
) -> Float[ndarray, "P 3"]:
    count = max(2, round(float(np.linalg.norm(end - start)) / cell * PIECES) + 1)
    return np.linspace(start, end, count)


def _seen(camera: Camera, way: Float[ndarray, "P 3"]) -> Iterator[Line]:
    """The parts of a line that come into a picture, with as few points as will do."""
    pixels, valid = camera.project(way)
    size = np.array(camera.image_size)
    ahead = camera.to_camera(way)[:, 2] > NEAR
    beside = np.abs(pixels - size / 2.0) < (0.5 + OFF) * size
    kept = valid & ahead & beside.all(axis=1)
    for part in np.split(np.arange(len(way)), np.flatnonzero(np.diff(kept)) + 1):
        if not kept[part[0]] or len(part) < 2:
            continue
        points = pixels[part].astype(np.float32)[:, None]
        fewer = np.asarray(cv2.approxPolyDP(points, TOLERANCE, closed=False))[:, 0]
        yield [(round(x, 1), round(y, 1)) for x, y in fewer.tolist()]


router = APIRouter(prefix="/api", responses=ERRORS)


@router.get("/floor")
def floor(bench: Bench) -> Floor:
    """A grid of whole metres or half ones on the room's floor, as each camera sees it."""
    return floor_of(opened(bench)[1])


TINT = (214, 100, 244)
"""Blue, green, red: a magenta that neither rooms nor the ids' colours have."""

INSIDE, BORDER = 84, 235
"""Opacity of 255: the picture is seen through the foreground, its outline stands out."""

_no_foreground = missing("no_foreground")


@router.get(
    "/foreground/{sequence_key}/{camera}/{step}.png",
    **a_file("image/png", "The tinted foreground."),
)
def foreground(
    bench: Bench,
    sequence_key: str,
    camera: int,
    step: int,
    run: Kept = None,
) -> Response:
    """One camera's foreground at one step of the shown run, to be laid over its picture."""
    mask = _mask(bench.snapshot(), sequence_key, camera, step, run)
    return png(tinted(mask), run)


def tinted(mask: UInt8[ndarray, "h w"]) -> bytes:
    """A transparent PNG: the foreground tinted, with its outline."""
    picture = np.empty((*mask.shape, 4), dtype=np.uint8)
    picture[:, :, :3] = TINT
    inner = cv2.erode(mask, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    picture[:, :, 3] = np.where(inner > 0, INSIDE, np.where(mask > 0, BORDER, 0))
    done, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 2])
    assert done, "a picture of four channels can be written as PNG"
    return bytes(data)


def _mask(
    snapshot: Snapshot, sequence_key: str, camera: int, step: int, wanted: str | None
) -> UInt8[ndarray, "h w"]:
    sequence, _ = checked(snapshot, sequence_key, camera, step, _no_foreground)
    run = snapshot.run
    if run is None or step >= run.done:
        raise _no_foreground(
            f"Step {step} is not computed yet.", "Ask again when the run is there."
        )
    if wanted is not None and wanted != run.keys.get("single_view"):
        raise _no_foreground("That run is not shown any more.", "Ask for the step again.")
    packed = run.views[step][camera].foreground if step < len(run.views) else None
    if packed is None:
        name, method = sequence.views[camera].camera.name, run.parameters.single_view
        raise _no_foreground(
            f'There is no foreground of camera "{name}" at step {step}: {method} had no picture '
            "there, or looks at none.",
            "Choose a single-view method that looks at pictures.",
        )
    return unpack(packed)


LOW, HIGH = (200, 84, 26), (150, 255, 190)
"""Blue, green, red of a small and of the largest likelihood: hues that neither skin, wood nor the
marks of boxes have."""

DIM, OPAQUE = 110, 235
"""Opacities of 255: of the shade over what looks like nobody, and where the colours are just a
template's."""

_no_likelihood = missing("no_likelihood")
"""The answer where there is no map."""


def key_of(sequence: Sequence, parameters: ColourPhdParams) -> str:
    """Names what a map depends on besides its picture, so that it may be kept for ever."""
    parts = (
        sequence.digest,
        parameters.colour_space,
        parameters.histogram_kernel,
        parameters.likelihood_sigma,
        parameters.acceptance_distance,
        (LOW, HIGH, DIM, OPAQUE),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def shown_colours(snapshot: Snapshot) -> ColourPhdParams:
    """The numbers of the run that is shown, else those that are chosen."""
    run = snapshot.run
    return (run.parameters if run is not None else snapshot.parameters).of(ColourPhdParams)


class Likelihoods:
    """Makes the maps; keeps the colour model and the sizes of those asked for last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._key = ""
        self._model: ColourModel | None = None
        self._sizes: dict[int, BoxSizes] = {}

    def png(
        self,
        sequence: Sequence,
        reader: FrameReader,
        parameters: ColourPhdParams,
        camera: int,
        picture: UInt8[ndarray, "h w 3"],
    ) -> bytes:
        """One map as a transparent PNG of a pixel a cell.

        Args:
            sequence: Whose templates.
            reader: Of the pictures that they are in.
            parameters: Of the colours.
            camera: Index.
            picture: Of this camera, BGR.

        Raises:
            ApiError: If there is no template to compare it with.
        """
        model, sizes = self._prepared(sequence, reader, parameters, camera)
        sigma = parameters.likelihood_sigma
        least = -0.5 * (parameters.acceptance_distance / sigma) ** 2
        return heat(likelihood_map(picture, model, sizes, sigma), least)

    def _prepared(
        self, sequence: Sequence, reader: FrameReader, parameters: ColourPhdParams, camera: int
    ) -> tuple[ColourModel, BoxSizes]:
        key = key_of(sequence, parameters)
        with self._lock:
            if key != self._key or self._model is None:
                space, kernel = parameters.colour_space, parameters.histogram_kernel
                try:
                    self._model = read_templates(sequence, space, kernel, reader)
                except ValueError as error:
                    raise _no_likelihood(sentence(error), None) from None
                self._key, self._sizes = key, {}
            if camera not in self._sizes:
                self._sizes[camera] = BoxSizes.of(
                    sequence.cameras[camera], sequence.room, sequence.target_half_extents
                )
            return self._model, self._sizes[camera]


def heat(values: Float[ndarray, "rows columns"], least: float) -> bytes:
    """Log-likelihoods as a transparent PNG: the likelier, the brighter and the denser.

    All else lies in shade, or what is likely would be lost in a bright picture.

    Args:
        values: 0 at most.
        least: What is at least so likely is seen; below 0.
    """
    share = np.clip(1.0 - values / least, 0.0, 1.0)[:, :, None]
    picture = np.empty((*values.shape, 4), dtype=np.uint8)
    seen = np.minimum(1.0, 8.0 * share)  # out of the shade there is no hard edge
    picture[:, :, :3] = np.rint(seen * (np.array(LOW) * (1.0 - share) + np.array(HIGH) * share))
    picture[:, :, 3] = np.rint(DIM + (OPAQUE - DIM) * np.sqrt(share[:, :, 0]))
    done, data = cv2.imencode(".png", picture)
    assert done, "a picture of four channels can be written as PNG"
    return bytes(data)


@router.get(
    "/likelihood/{sequence_key}/{camera}/{step}.png", **a_file("image/png", "A pixel a cell.")
)
def likelihood(
    maps: Annotated[Likelihoods, of_app("likelihoods")],
    bench: Bench,
    sequence_key: str,
    camera: int,
    step: int,
    run: Kept = None,
) -> Response:
    """How much a person's box at each place of a picture looks like one of the templates."""
    snapshot = bench.snapshot()
    sequence, reader = checked(snapshot, sequence_key, camera, step, _no_likelihood)
    picture = picture_of(sequence, reader, camera, step, _no_likelihood)
    if run is not None and run != key_of(sequence, shown_colours(snapshot)):
        raise _no_likelihood(
            "The templates or colours are others by now.", "Ask for the step again."
        )
    return png(maps.png(sequence, reader, shown_colours(snapshot), camera, picture), run)

"""A detection network in OpenCV: from an image to boxes of people in its pixels."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.sequences.detectors import check_model_size
from tracker.single_view.onnx.file import INT64, UINT8, Port, ports_of
from tracker.single_view.onnx.layouts import FOUND_OUT, proposals

Values = Literal["unit", "imagenet", "signed", "bytes", "imagenet_bgr"]

INPUT_SIDE, PIXEL_VALUES = "input_side", "pixel_values"
"""Keys of an ONNX file's metadata by which it says how it wants its pictures; as the parameters."""

_SIDE = 640
"""Longer side of a network's picture where neither file nor parameter says it, pixels: YOLO's."""
MOST_SIDE = 2048
"""Largest side that metadata or the parameter may ask for, pixels."""
_CELL = 32
"""Sides that are left open are multiples of this, the known layouts' largest stride, pixels."""

_GREY = 114
"""Grey level of the borders that fill an image up to the network's shape, as in YOLO's training."""
_IMAGENET_MEAN = np.array([0.485, 0.456, 0.406], np.float32)
_IMAGENET_DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """N boxes of people in one image."""

    boxes: Float[ndarray, "N 4"]
    """left, top, width, height, pixels of the image."""
    scores: Float[ndarray, " N"]
    """Score of each box, 0 … 1."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Parameters of the input and output of a network."""

    person: int = FOUND_OUT
    """Index of the class, or -1 for that of people by the layout."""
    score: float = 0.35
    """Score below which boxes are left out, 0 … 1."""
    overlap: float = 0.6
    """Intersection over union above which the weaker box is dropped, 0 … 1."""
    side: int = 0
    """Longer side of the network's input image, where the file has a variable size, pixels; 0 for
    what the file's metadata say."""
    values: Values | Literal["file"] = "file"
    """Scaling of an image's bytes for the network; "file" for what the file's metadata say."""


_REMEDY = "export it to ONNX again with one picture at a time"
"""Remedy in messages about a network that cannot be run here."""


class Network:
    """A model that detects people, in one image at a time.

    OpenCV distributes one image over the cores by itself, so a second copy for another
    camera would only need memory.
    """

    def __init__(self, path: Path, settings: Settings) -> None:
        """Read a model.

        Raises:
            ValueError: If the file is no ONNX model, or none with an image as input; the
                message names the file.
        """
        self._path, self._settings = path, settings
        try:
            data = _content(path)
            ports = ports_of(data)
            self._net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
        except OSError as error:
            raise ValueError(
                f"the detector {path} cannot be read ({error.strerror}); name an ONNX file"
            ) from error
        except ValueError as error:
            message = self._message(
                f"cannot be used: {error}", "name a network that was exported to ONNX"
            )
            raise ValueError(message) from error
        except cv2.error as error:
            raise ValueError(self._message(f"cannot be used: {_words(error)}")) from error
        self._picture = self._picture_port(ports.inputs)
        self._own_side, self._own_values = _own(ports.metadata)
        self._sizes = [p for p in ports.inputs if p is not self._picture]
        self._names = [port.name for port in ports.outputs]
        self._lock = threading.Lock()

    @classmethod
    def tried(cls, path: Path) -> Network:
        """A model that was run on an empty image, so that its outputs can be read.

        Raises:
            ValueError: In the cases of the constructor and of :meth:`detect`.
        """
        network = cls(path, Settings())
        network.detect(np.full((_SIDE, _SIDE, 3), _GREY, np.uint8))
        return network

    def with_settings(self, settings: Settings) -> Network:
        """The same model with other parameters; it is in memory once."""
        other = copy.copy(self)
        other._settings = settings
        return other

    def size_for(self, columns: int, rows: int) -> tuple[int, int]:
        """The width and height of the network's input for a picture, pixels.

        Sides that the file leaves open are in the picture's proportions, the longer one as the
        settings or the file say, both rounded up to whole cells.

        Args:
            columns: Width of the picture, pixels.
            rows: Height of the picture, pixels.
        """
        shape = self._picture.shape
        height, width = shape[1:3] if self._channels_last else shape[2:4]
        side = self._settings.side or self._own_side
        if not width and not height:
            scale = side / max(columns, rows)
            return _whole_cells(columns * scale), _whole_cells(rows * scale)
        return width or side, height or side

    @property
    def _channels_last(self) -> bool:
        return self._picture.shape[1] != 3 and self._picture.shape[3] == 3

    def _message(self, words: str, remedy: str = _REMEDY) -> str:
        """Make the message of an error: the file, what is wrong with it, and the remedy."""
        return f"the detector {self._path.name} {words}; {remedy}"

    def _picture_port(self, inputs: tuple[Port, ...]) -> Port:
        """Return the input for the picture."""
        for port in inputs:
            if len(port.shape) == 4 and 3 in (port.shape[1], port.shape[3]):
                if port.shape[0] > 1:
                    raise ValueError(self._message(f"takes {port.shape[0]} pictures at a time"))
                return port
        shapes = ", ".join(f"{p.name} {p.shape}" for p in inputs)
        raise ValueError(
            self._message(
                f"takes no picture: expected an input (1, 3, height, width), found {shapes}"
            )
        )

    def detect(self, picture: UInt8[ndarray, "h w 3"]) -> Found:
        """Detect the people in an image (blue, green, red).

        The image is scaled to fit into the network's input with its aspect ratio, in the middle
        of grey borders; the boxes are converted to its own pixels and clipped to it.

        Raises:
            ValueError: If the network cannot run on it, or its outputs have no known layout.
        """
        rows, columns = picture.shape[:2]
        width, height = self.size_for(columns, rows)
        scale = min(width / columns, height / rows)
        inner = max(1, round(columns * scale)), max(1, round(rows * scale))
        shift = np.array([(width - inner[0]) // 2, (height - inner[1]) // 2])
        framed = np.full((height, width, 3), _GREY, np.uint8)
        flags = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
        framed[shift[1] : shift[1] + inner[1], shift[0] : shift[0] + inner[0]] = cv2.resize(
            picture, inner, interpolation=flags
        )
        outputs = self._forward(self._fed(framed), (width, height))
        s = self._settings
        try:
            found = proposals(outputs, (width, height), s.person)
        except ValueError as error:
            raise ValueError(f"the detector {self._path.name} cannot be used: {error}") from error
        kept = found.scores >= s.score
        corners, scores = found.corners[kept].astype(float), found.scores[kept].astype(float)
        # centres of neighbouring pixels are 1 apart, and edges lie between them
        factors = np.tile(np.array(inner) / [columns, rows], 2)
        corners = (corners - np.tile(shift, 2)) / factors - 0.5
        corners[:, 0::2] = np.clip(corners[:, 0::2], -0.5, columns - 0.5)
        corners[:, 1::2] = np.clip(corners[:, 1::2], -0.5, rows - 0.5)
        boxes = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
        sound = np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > 0.5).all(axis=1)
        boxes, scores = boxes[sound], np.clip(scores[sound], 0.0, 1.0)
        order = np.argsort(-scores, kind="stable")
        boxes, scores = boxes[order], scores[order]
        if not found.suppressed and len(boxes):
            best = cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), 0.0, s.overlap)
            stay = np.sort(np.asarray(best, dtype=int).reshape(-1))
            boxes, scores = boxes[stay], scores[stay]
        return Found(boxes, scores)

    def _fed(self, framed: UInt8[ndarray, "h w 3"]) -> ndarray:
        """Return the picture as the input of the network."""
        coloured = framed[:, :, ::-1]
        values = self._settings.values
        if self._picture.kind != UINT8:
            match self._own_values if values == "file" else values:
                case "unit":
                    coloured = coloured.astype(np.float32) / 255.0
                case "imagenet":
                    coloured = (coloured.astype(np.float32) / 255.0 - _IMAGENET_MEAN) / (
                        _IMAGENET_DEVIATION
                    )
                case "signed":
                    coloured = coloured.astype(np.float32) / 127.5 - 1.0
                case "bytes":
                    coloured = coloured.astype(np.float32)
                case "imagenet_bgr":
                    coloured = (framed.astype(np.float32) / 255.0 - _IMAGENET_MEAN[::-1]) / (
                        _IMAGENET_DEVIATION[::-1]
                    )
        if not self._channels_last:
            coloured = coloured.transpose(2, 0, 1)
        return np.ascontiguousarray(coloured[None])

    def _forward(self, fed: ndarray, size: tuple[int, int]) -> dict[str, ndarray]:
        """Run the network, and return its outputs by name.

        Args:
            fed: The input of the network.
            size: Its width and height, pixels.
        """
        try:
            with self._lock:
                self._net.setInput(fed, self._picture.name)
                for port in self._sizes:  # the size to which boxes are scaled, for RT-DETR
                    kind = np.int64 if port.kind == INT64 else np.float32
                    self._net.setInput(np.array([size], kind), port.name)
                outputs = self._net.forward(self._names)
                return {n: np.array(o) for n, o in zip(self._names, outputs, strict=True)}
        except cv2.error as error:
            raise ValueError(self._message(f"cannot be run: {_words(error)}")) from error


def _own(metadata: Mapping[str, str]) -> tuple[int, Values]:
    """Read the side and the scaling that a file's metadata say; else YOLO's."""
    side, values = metadata.get(INPUT_SIDE, ""), metadata.get(PIXEL_VALUES, "")
    return (
        int(side) if side.isdecimal() and 0 < int(side) <= MOST_SIDE else _SIDE,
        cast(Values, values) if values in get_args(Values) else "unit",
    )


def _whole_cells(length: float) -> int:
    """Round a length up to whole cells; what is above by less than a pixel is rounding."""
    return max(1, math.ceil(length / _CELL - 1.0 / _CELL)) * _CELL


def _content(path: Path) -> bytes:
    """Read the bytes of a model, from a regular file of at most the size that ONNX allows."""
    check_model_size(path)
    return path.read_bytes()


def _words(error: Exception) -> str:
    """The message of OpenCV without the place in its sources."""
    words = " ".join(str(error).split())
    return words.rsplit("error: ", 1)[-1][:160]

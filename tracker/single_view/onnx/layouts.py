"""Interpretation of a detector's outputs, by their shapes and names.

The known layouts are, with C classes and N proposed boxes:

- YOLOv5 to v7 [JCS22]: (1, N, 5 + C): centre, size, objectness, classes; YOLOv8 to v12, as they
  are exported: (1, 4 + C, N), without objectness;
- end-to-end (YOLOv10 and exports with their own suppression): (1, K, 6): two corners, score,
  class; (K, 7): picture, two corners, class, score;
- DETR [CMS20] and similar: logits (1, N, C) and boxes (1, N, 4) as shares of the image; RT-DETR
  [ZLX24] also as one (1, N, 4 + C), or as labels, boxes and scores;
- SSD [LAE16]: (1, 1, N, 7): picture, class, score, two corners; or boxes and scores by class;
- CenterNet [ZWK19]: heat map (1, C, h, w), sizes (1, 2, h, w) and offsets (1, 2, h, w);
- NanoDet: for each stride s of 8, 16 and 32 the scores ``cls_pred_stride_s`` (1, h w / s², C) and
  the distances ``dis_pred_stride_s`` (1, h w / s², 4 n), each a distribution over n values
  [LWW20].

[JCS22] Jocher et al., "ultralytics/yolov5", 2022.
[CMS20] Carion et al., "End-to-End Object Detection with Transformers", ECCV 2020.
[ZLX24] Zhao et al., "DETRs Beat YOLOs on Real-time Object Detection", CVPR 2024.
[LAE16] Liu et al., "SSD: Single Shot MultiBox Detector", ECCV 2016.
[ZWK19] Zhou, Wang, Krähenbühl, "Objects as Points", 2019.
[LWW20] Li et al., "Generalized Focal Loss: Learning Qualified and Distributed Bounding Boxes for
Dense Object Detection", NeurIPS 2020.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

FOUND_OUT = -1
"""Value for a class: that of people, by the usual order of such a network's classes."""
_STRIDES = (8, 16, 32)
_SHARE = 1.5
"""Largest value of boxes that are shares of the image, not pixels."""
_CENTRES = 200
"""Largest number of objects from a heat map."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Boxes of one class in the network's input image."""

    corners: Float[ndarray, "N 4"]
    """Left, top, right, bottom, pixels of the network's input image."""
    scores: Float[ndarray, " N"]
    """Score of each box, 0 … 1."""
    suppressed: bool
    """Whether the network itself suppresses all but one box for each object."""


def proposals(
    outputs: Mapping[str, ndarray], size: tuple[int, int], wanted: int = FOUND_OUT
) -> Proposals:
    """Read the boxes of people from the outputs of a detector.

    Args:
        outputs: The outputs by name, with the dimension of the batch, for one image.
        size: Width and height of the network's input image, pixels.
        wanted: Index of the class, or -1 for that of people.

    Raises:
        ValueError: If the outputs have no known layout.
    """
    arrays = {name: np.asarray(a, dtype=np.float32) for name, a in outputs.items()}
    found = (
        _nano_det(arrays, size, wanted)
        or _centre_net(arrays, size, wanted)
        or _named(arrays, size, wanted)
        or _boxes_and_scores(arrays, size, wanted)
        or _one_output(arrays, size, wanted)
    )
    if found is None:
        shapes = ", ".join(f"{name} {tuple(a.shape)}" for name, a in arrays.items())
        raise ValueError(
            f"its outputs {shapes} are of no known layout; expected those of YOLO, DETR, RT-DETR, "
            "SSD, CenterNet or NanoDet"
        )
    return found


def _class(wanted: int, usual: int) -> int:
    return usual if wanted == FOUND_OUT else wanted


def _sigmoid(values: ndarray) -> ndarray:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(values, -60.0, 60.0))))


def _probabilities(scores: ndarray) -> ndarray:
    """The scores themselves if they are probabilities; else they are logits."""
    if scores.size and (scores.min() < 0.0 or scores.max() > 1.0):
        return _sigmoid(scores)
    return scores


def _in_pixels(corners: ndarray, size: tuple[int, int]) -> ndarray:
    if corners.size and np.abs(corners).max() <= _SHARE:
        return np.asarray(corners * np.tile(size, 2))
    return corners


def _from_centres(boxes: ndarray) -> ndarray:
    half = boxes[:, 2:] / 2.0
    return np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)


def _grid(size: tuple[int, int]) -> int:
    """Number of cells of the grids of strides 8, 16 and 32."""
    return sum((size[0] // s) * (size[1] // s) for s in _STRIDES)


def _column(scores: ndarray, index: int) -> ndarray:
    """The scores (N, C) of one class.

    Raises:
        ValueError: If there is no such class.
    """
    if not 0 <= index < scores.shape[1]:
        raise ValueError(
            f"it tells {scores.shape[1]} classes apart, and class {index} is asked for"
        )
    return np.asarray(scores[:, index])


def _one_output(
    arrays: Mapping[str, ndarray], size: tuple[int, int], wanted: int
) -> Proposals | None:
    """Read a single table; other outputs of more dimensions (masks) are ignored."""
    tables = [a for a in arrays.values() if a.ndim in (2, 3)]
    if len(arrays) == 1:
        tables = list(arrays.values())
    if len(tables) != 1:
        return None
    table = tables[0]
    if table.ndim == 4 and table.shape[1] == 1 and table.shape[3] == 7:
        return _ssd(table[0, 0], size, wanted)
    by_picture = table.ndim == 3 and table.shape[0] == 1
    if by_picture:
        table = table[0]
    if table.ndim != 2 or not (by_picture or table.shape[1] in (6, 7)):
        return None
    rows, columns = table.shape
    grid = _grid(size)
    if rows >= 5 and columns == grid and rows != grid:
        table = table.T  # (4 + C, N)
        return Proposals(
            _in_pixels(_from_centres(table[:, :4]), size),
            _probabilities(_column(table[:, 4:], _class(wanted, 0))),
            False,
        )
    if columns >= 6 and rows in (grid, 3 * grid):
        objectness = _probabilities(table[:, 4])
        scores = objectness * _probabilities(_column(table[:, 5:], _class(wanted, 0)))
        return Proposals(_in_pixels(_from_centres(table[:, :4]), size), scores, False)
    if columns == 6:
        chosen = np.round(table[:, 5]) == _class(wanted, 0)
        return Proposals(_in_pixels(table[:, :4], size)[chosen], table[chosen, 4], True)
    if columns == 7:
        chosen = (np.round(table[:, 5]) == _class(wanted, 0)) & (np.round(table[:, 0]) == 0)
        return Proposals(_in_pixels(table[:, 1:5], size)[chosen], table[chosen, 6], True)
    if columns > 7 and rows <= 1000:
        classes = _probabilities(_column(table[:, 4:], _class(wanted, 0)))
        return Proposals(_in_pixels(_from_centres(table[:, :4]), size), classes, True)
    if 5 <= rows < columns:  # the grid of another input size, as with four strides
        table = table.T
        classes = _probabilities(_column(table[:, 4:], _class(wanted, 0)))
        return Proposals(_in_pixels(_from_centres(table[:, :4]), size), classes, False)
    return None


def _ssd(table: ndarray, size: tuple[int, int], wanted: int) -> Proposals:
    chosen = (np.round(table[:, 1]) == _class(wanted, 1)) & (table[:, 0] >= 0.0)
    return Proposals(_in_pixels(table[:, 3:7], size)[chosen], table[chosen, 2], True)


def _named(arrays: Mapping[str, ndarray], size: tuple[int, int], wanted: int) -> Proposals | None:
    """Read labels, boxes and scores for every object (RT-DETR, SSD, exports of frameworks)."""
    if len(arrays) < 3:
        return None
    boxes = next((n for n, a in arrays.items() if a.ndim >= 2 and a.shape[-1] == 4), None)
    if boxes is None:
        return None
    table = arrays[boxes].reshape(-1, 4)
    rest = {
        name: a.reshape(-1) for name, a in arrays.items() if name != boxes and a.size == len(table)
    }
    if len(rest) < 2:
        return None
    if not len(table):  # no detection
        return Proposals(table, np.zeros(0, np.float32), True)
    # outputs without known names are distinguished by their values, also with a single class
    whole = [n for n, a in rest.items() if np.array_equal(a, np.round(a))]
    labels = next(
        (n for n in rest if "label" in n or "class" in n),
        next((n for n in whole if rest[n].max() > 1 or len(whole) == 1), None),
    )
    scores = next((n for n in rest if "score" in n or "conf" in n), None)
    scores = scores or next(n for n in rest if n != labels)
    if labels is None or labels == scores:
        return None
    # the object detection API of TensorFlow: top, left, bottom, right, and classes from 1
    swapped = "detection_boxes" in boxes
    corners = table[:, [1, 0, 3, 2]] if swapped else table
    usual = 1 if swapped or _from_one(boxes) else 0
    chosen = np.round(rest[labels]) == _class(wanted, usual)
    return Proposals(_in_pixels(corners, size)[chosen], rest[scores][chosen], True)


def _from_one(boxes: str) -> bool:
    """Whether classes are counted from 1, as in an SSD with an output ``bboxes``."""
    return boxes == "bboxes"


def _boxes_and_scores(
    arrays: Mapping[str, ndarray], size: tuple[int, int], wanted: int
) -> Proposals | None:
    """Read boxes (1, N, 4) and scores by class (1, N, C): DETR and similar, and SSD."""
    tables = {n: a[0] for n, a in arrays.items() if a.ndim == 3 and a.shape[0] == 1}
    boxes = next((n for n, a in tables.items() if a.shape[1] == 4), None)
    scores = next(
        (n for n, a in tables.items()
         if n != boxes and boxes is not None and len(a) == len(tables[boxes])),
        None,
    )  # fmt: skip
    if boxes is None or scores is None:
        return None
    values, count = tables[scores], tables[scores].shape[1]
    queries = len(values) <= 1000
    if not queries:  # an SSD: corners, and the first class is nothing
        return Proposals(
            _in_pixels(tables[boxes], size),
            _column(_probabilities(values), _class(wanted, 1 if count > 1 else 0)),
            False,
        )
    usual = 1 if count in (91, 92) else 0  # COCO's own numbers begin with 1, a list of 80 with 0
    if count == 92:  # DETR: the last class is nothing
        shifted = np.exp(values - values.max(axis=1, keepdims=True))
        values = (shifted / shifted.sum(axis=1, keepdims=True))[:, :-1]
    else:
        values = _probabilities(values)
    return Proposals(
        _in_pixels(_from_centres(tables[boxes]), size), _column(values, _class(wanted, usual)), True
    )


_CLASSES, _DISTANCES = "cls_pred_stride_", "dis_pred_stride_"
"""Beginnings of the names of NanoDet's outputs; the stride follows."""


def _nano_det(
    arrays: Mapping[str, ndarray], size: tuple[int, int], wanted: int
) -> Proposals | None:
    """Read the cells of each stride where no other class has a higher score.

    With P_k(n) the distribution of the distance from the centre of a cell, in strides, to side k of
    the box (left, top, right, bottom), that side lies at s sum_n n P_k(n) from the centre, equation
    (5) of [LWW20]_.

    Raises:
        ValueError: If the outputs of a stride do not have a row for each of its cells.
    """
    names = [n.removeprefix(_CLASSES) for n in arrays if n.startswith(_CLASSES)]
    strides = sorted(int(name) for name in names if name.isdecimal() and int(name) > 0)
    if not strides or any(f"{_DISTANCES}{s}" not in arrays for s in strides):
        return None
    corners, scores = [np.zeros((0, 4), np.float32)], [np.zeros(0, np.float32)]
    for stride in strides:
        classes, sides = arrays[f"{_CLASSES}{stride}"][0], arrays[f"{_DISTANCES}{stride}"][0]
        across, down = size[0] // stride, size[1] // stride
        if not len(classes) == len(sides) == across * down:
            raise ValueError(
                f"its outputs of stride {stride} have {len(classes)} and {len(sides)} rows; "
                f"expected {across * down}, one for each cell of {size[0]} x {size[1]} pixels"
            )
        own = _column(classes, _class(wanted, 0))
        cells = np.flatnonzero(own >= classes.max(axis=1))
        values = sides[cells].reshape(len(cells), 4, sides.shape[1] // 4)
        shares = np.exp(values - values.max(axis=2, keepdims=True))
        shares /= shares.sum(axis=2, keepdims=True)
        left, top, right, bottom = stride * (shares @ np.arange(values.shape[2])).T
        x, y = (cells % across + 0.5) * stride, (cells // across + 0.5) * stride
        corners.append(np.stack([x - left, y - top, x + right, y + bottom], axis=1))
        scores.append(own[cells])
    return Proposals(np.concatenate(corners), np.concatenate(scores), False)


def _centre_net(
    arrays: Mapping[str, ndarray], size: tuple[int, int], wanted: int
) -> Proposals | None:
    """Read peaks of a heat map: cells that no neighbour exceeds."""
    maps = {n: a[0] for n, a in arrays.items() if a.ndim == 4 and a.shape[0] == 1}
    pairs = [n for n, a in maps.items() if a.shape[0] == 2]
    heat = [n for n, a in maps.items() if n not in pairs]
    if not heat and len(pairs) == 3:  # two classes: the first, as its makers write it
        heat, pairs = pairs[:1], pairs[1:]
    if len(heat) != 1 or len(pairs) != 2 or len(maps) != len(arrays):
        return None
    if maps[heat[0]].shape[1:] != maps[pairs[0]].shape[1:]:
        return None
    offset = next((n for n in pairs if "off" in n or "reg" in n), pairs[1])
    extent = next(n for n in pairs if n != offset)
    classes = maps[heat[0]].reshape(len(maps[heat[0]]), -1).T
    height, width = maps[heat[0]].shape[1:]
    scores = _probabilities(_column(classes, _class(wanted, 0))).reshape(height, width)
    padded = np.pad(scores, 1, constant_values=-np.inf)
    around = np.stack(
        [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    ).max(axis=0)
    peaks = np.flatnonzero((scores >= around).ravel())
    peaks = peaks[np.argsort(-scores.ravel()[peaks], kind="stable")][:_CENTRES]
    y, x = np.divmod(peaks, width)
    centres = np.stack([x, y], axis=1) + maps[offset].reshape(2, -1).T[peaks]
    cells = np.concatenate([centres, maps[extent].reshape(2, -1).T[peaks]], axis=1)
    stride = np.array([size[0] / width, size[1] / height])
    return Proposals(_from_centres(cells) * np.tile(stride, 2), scores.ravel()[peaks], True)

"""A small TensorFlow.js graph model with every operation that is converted, and its answer."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy import ndarray

SIDE = 64
"""Side of the picture that the graph was traced with."""
CLASSES, BINS = 3, 5
OUTPUTS = {"cls_pred_stride_8": "Identity", "dis_pred_stride_8": "Identity_1"}


class GraphModel:
    """A graph as TensorFlow.js has it, in the making."""

    def __init__(self, seed: int = 0) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.table: list[dict[str, Any]] = []
        self.weights = b""
        self._rng = np.random.default_rng(seed)

    def constant(self, name: str, values: ndarray) -> str:
        """Weights are stored as float16, all else as int32 or, what is infinite, as float32."""
        entry: dict[str, Any] = {"name": name, "shape": list(values.shape)}
        if values.dtype.kind == "i":
            self.table.append(entry | {"dtype": "int32"})
            self.weights += values.astype("<i4").tobytes()
        elif not np.isfinite(values).all():
            self.table.append(entry | {"dtype": "float32"})
            self.weights += values.astype("<f4").tobytes()
        else:
            quantization = {"dtype": "float16", "original_dtype": "float32"}
            self.table.append(entry | {"dtype": "float32", "quantization": quantization})
            self.weights += values.astype("<f2").tobytes()
        self.nodes.append({"name": name, "op": "Const"})
        return name

    def node(self, op: str, name: str, inputs: list[str], **attributes: Any) -> str:
        self.nodes.append({"name": name, "op": op, "input": inputs, "attr": attributes})
        return name

    def transposed(self, name: str, source: str, order: list[int]) -> str:
        return self.node("Transpose", name, [source, self.constant(f"{name}/perm", ints(*order))])

    def last(self, name: str, source: str) -> str:
        return self.transposed(name, source, [0, 2, 3, 1])

    def first(self, name: str, source: str) -> str:
        return self.transposed(name, source, [0, 3, 1, 2])

    def padded(self, name: str, source: str, outside: float | None = None) -> str:
        borders = self.constant(f"{name}/borders", np.array([[0, 0], [0, 0], [1, 1], [1, 1]]))
        if outside is None:
            return self.node("Pad", name, [source, borders])
        value = self.constant(f"{name}/value", np.array(outside, np.float32))
        return self.node("PadV2", name, [source, borders, value])

    def convolved(self, name: str, source: str, inputs: int, outputs: int, stride: int) -> str:
        """Of a picture with its channels first, padded by one: 3 x 3, with a bias."""
        last = self.last(f"{name}/last", self.padded(f"{name}/pad", source))
        kernel = self._rng.normal(0.0, 0.3, (3, 3, inputs, outputs))
        weights = self.constant(f"{name}/kernel", kernel)
        convolution = self.node(
            "Conv2D", f"{name}/conv", [last, weights],
            padding=text("VALID"), data_format=text("NHWC"),
            strides=numbers(1, stride, stride, 1), dilations=numbers(1, 1, 1, 1),
        )  # fmt: skip
        bias = self.constant(f"{name}/bias", self._rng.normal(size=outputs))
        return self.first(name, self.node("Add", f"{name}/sum", [convolution, bias]))

    def resized(self, name: str, source: str, side: int) -> str:
        size = self.constant(f"{name}/size", ints(side, side))
        resized = self.node(
            "ResizeBilinear", f"{name}/resize", [self.last(f"{name}/last", source), size],
            half_pixel_centers={"b": True}, align_corners={"b": False},
        )  # fmt: skip
        return self.first(name, resized)

    @property
    def model(self) -> dict[str, Any]:
        return {
            "modelTopology": {"node": self.nodes},
            "weightsManifest": [{"paths": ["model.bin"], "weights": self.table}],
        }


def ints(*values: int) -> ndarray:
    return np.array(values, np.int64)


def numbers(*values: int) -> dict[str, Any]:
    return {"list": {"i": [str(value) for value in values]}}


def text(words: str) -> dict[str, str]:
    return {"s": base64.b64encode(words.encode()).decode()}


def detector(seed: int = 0) -> GraphModel:
    """NanoDet's outputs of stride 8, by two convolutions, a pooling, and a path of half the size.

    Its nodes are listed from the last to the first, for a file may have them in any order.
    """
    g = GraphModel(seed)
    shape = {"dim": [{"size": str(size)} for size in (1, 3, SIDE, SIDE)]}
    g.node("Placeholder", "images", [], shape={"shape": shape})
    one = g.node("LeakyRelu", "relu", [g.convolved("one", "images", 3, 8, 2)], alpha={"f": 0.1})
    pooled = g.node(
        "MaxPool", "pool", [g.last("pool/last", g.padded("pool/pad", one, -np.inf))],
        padding=text("VALID"), data_format=text("NHWC"),
        ksize=numbers(1, 3, 3, 1), strides=numbers(1, 2, 2, 1),
    )  # fmt: skip
    two = g.convolved("two", g.first("pool/first", pooled), 8, 8, 2)
    small = g.resized("small", two, SIDE // 16)
    again = g.resized("again", small, SIDE // 8)
    total = g.node("AddV2", "total", [two, again])
    axis = g.constant("concat/axis", np.array(1))
    both = g.node("ConcatV2", "concat", [total, two, axis])
    last = g.convolved("last", both, 16, CLASSES + 4 * BINS, 1)
    sizes, split_axis = ints(CLASSES, 4 * BINS), g.constant("split/axis", np.array(1))
    g.node("SplitV", "split", [last, g.constant("split/sizes", sizes), split_axis])
    zeros = [
        g.constant("none", np.zeros((0, 1), np.int64)), g.constant("three", ints(3)),
        g.constant("no values", np.zeros(0, np.int64)), g.constant("zero", np.array(0)),
    ]  # fmt: skip
    nothing = g.node("SparseToDense", "nothing", zeros)
    sigmoid = g.node("Sigmoid", "sigmoid", ["split"])
    for name, source, channels in (("Identity", sigmoid, CLASSES), ("Identity_1", "split:1", 20)):
        asked = g.constant(f"{name}/asked", ints(1, channels, -1))
        joined = g.node("AddV2", f"{name}/shape", [asked, nothing])
        reshaped = g.node("Reshape", f"{name}/reshape", [source, joined])
        g.node("Identity", name, [g.transposed(f"{name}/last", reshaped, [0, 2, 1])])
    g.nodes.reverse()
    return g


def answer(graph: GraphModel, picture: ndarray) -> list[ndarray]:
    """What TensorFlow makes of a picture, node by node, in plain loops where they are plainest."""
    known: dict[str, ndarray] = {}
    place = 0
    for entry in graph.table:
        kind = np.dtype(entry.get("quantization", entry)["dtype"]).newbyteorder("<")
        count = int(np.prod(entry["shape"], dtype=int))
        values = np.frombuffer(graph.weights, kind, count, place).reshape(entry["shape"])
        known[entry["name"]] = values.astype(np.int64 if kind.kind == "i" else np.float64)
        place += values.nbytes
    scale = picture.shape[2] / SIDE, picture.shape[3] / SIDE
    for node in reversed(graph.nodes):
        name, inputs = node["name"], [known[i] for i in node.get("input", [])]
        match node["op"]:
            case "Placeholder":
                known[name] = picture
            case "Identity":
                known[name] = inputs[0]
            case "Transpose":
                known[name] = inputs[0].transpose(inputs[1])
            case "Pad" | "PadV2":
                outside = inputs[2].item() if len(inputs) > 2 else 0.0
                known[name] = np.pad(inputs[0], inputs[1], constant_values=outside)
            case "Conv2D" | "MaxPool":
                stride = int(node["attr"]["strides"]["list"]["i"][1])
                known[name] = slid(inputs[0], inputs[1] if len(inputs) > 1 else None, stride)
            case "Add" | "AddV2":
                known[name] = inputs[0] + inputs[1]
            case "LeakyRelu":
                known[name] = np.where(inputs[0] < 0.0, 0.1 * inputs[0], inputs[0])
            case "Sigmoid":
                known[name] = 1.0 / (1.0 + np.exp(-inputs[0]))
            case "ConcatV2":
                known[name] = np.concatenate(inputs[:-1], axis=int(inputs[-1]))
            case "SplitV":
                parts = np.split(inputs[0], [int(inputs[1][0])], axis=int(inputs[2]))
                known[name], known[f"{name}:1"] = parts
            case "ResizeBilinear":
                height, width = (round(n * s) for n, s in zip(inputs[1], scale, strict=True))
                known[name] = resized(inputs[0], height, width)
            case "Reshape":
                known[name] = inputs[0].reshape(inputs[1])
            case "SparseToDense":
                known[name] = np.full(inputs[1], inputs[3])
    return [known[name] for name in OUTPUTS.values()]


def slid(image: ndarray, kernel: ndarray | None, stride: int) -> ndarray:
    """A 3 x 3 window over (1, h, w, C): its weighted sums, or its maxima."""
    rows, columns = ((n - 3) // stride + 1 for n in image.shape[1:3])
    out = np.zeros((1, rows, columns, image.shape[3] if kernel is None else kernel.shape[3]))
    for r in range(rows):
        for c in range(columns):
            window = image[0, r * stride : r * stride + 3, c * stride : c * stride + 3]
            sums = None if kernel is None else np.tensordot(window, kernel, 3)
            out[0, r, c] = window.max(axis=(0, 1)) if sums is None else sums
    return out


def resized(image: ndarray, height: int, width: int) -> ndarray:
    """Bilinear between the centres of pixels, which repeats the outermost ones."""
    out = np.zeros((1, height, width, image.shape[3]))
    for r in range(height):
        for c in range(width):
            places = (
                (r + 0.5) * image.shape[1] / height - 0.5,
                (c + 0.5) * image.shape[2] / width - 0.5,
            )
            for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
                whole = [int(np.floor(p)) + k for p, k in zip(places, corner, strict=True)]
                share = np.prod([1.0 - abs(p - w) for p, w in zip(places, whole, strict=True)])
                inside = [
                    min(max(w, 0), n - 1) for w, n in zip(whole, image.shape[1:3], strict=True)
                ]
                out[0, r, c] += share * image[0, inside[0], inside[1]]
    return out

"""Small networks with known answers: ONNX, TensorFlow.js, and a package that npm fetches."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import tarfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy import ndarray
from onnx import TensorProto, helper, numpy_helper

from tracker.single_view.onnx.fetching import Source

OPSET, IR = 13, 8


def answering(
    path: Path,
    outputs: Mapping[str, ndarray],
    *,
    size: tuple[int, int] = (64, 64),
    channels_last: bool = False,
    open_sizes: bool = False,
    score_is: Mapping[str, tuple[int, ...]] | None = None,
) -> Path:
    """A network whose outputs are given, whatever it is shown, but for one number of brightness.

    Args:
        path: Where to write it.
        outputs: By name.
        size: Width and height of its picture.
        channels_last: Whether that is (1, height, width, 3).
        open_sizes: Whether it takes pictures of any size.
        score_is: Of an output the index to which the picture's mean is added.
    """
    width, height = size
    given: list[int | str] = [1, height, width, 3] if channels_last else [1, 3, height, width]
    if open_sizes:
        given[2:] = ["height", "width"]
    nodes = [helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=1, axes=[0, 1, 2, 3])]
    weights, ports = [], []
    for name, answer in outputs.items():
        values = np.asarray(answer, np.float32)
        share = np.zeros_like(values)
        if score_is is not None and name in score_is:
            share[score_is[name]] = 1.0
        weights.append(numpy_helper.from_array(values, f"{name}_answer"))
        weights.append(numpy_helper.from_array(share, f"{name}_share"))
        ones = np.ones(values.ndim, np.int64)
        weights.append(numpy_helper.from_array(ones, f"{name}_ones"))
        nodes.append(helper.make_node("Reshape", ["mean", f"{name}_ones"], [f"{name}_mean"]))
        nodes.append(helper.make_node("Mul", [f"{name}_mean", f"{name}_share"], [f"{name}_part"]))
        nodes.append(helper.make_node("Add", [f"{name}_answer", f"{name}_part"], [name]))
        ports.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, values.shape))
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, given)
    graph = helper.make_graph(nodes, "answering", [picture], ports, weights)
    return _written(path, graph)


def pooling(path: Path, side: int = 32) -> Path:
    """A heat map of red: CenterNet's outputs at a quarter of the picture's size.

    The score of a cell is the mean red of its sixteen pixels less that of green; every box is
    3 by 5 cells, with its middle in the middle of the cell.
    """
    small = side // 4
    red = np.zeros((1, 3, 4, 4), np.float32)
    red[0, 0], red[0, 1] = 1.0 / 16.0, -1.0 / 16.0
    extent = np.zeros((1, 2, small, small), np.float32)
    extent[0, 0], extent[0, 1] = 3.0, 5.0
    offset = np.full((1, 2, small, small), 0.5, np.float32)
    nodes = [
        helper.make_node("Conv", ["images", "red"], ["signed"], strides=[4, 4]),
        helper.make_node("Relu", ["signed"], ["heat"]),
        helper.make_node("Conv", ["images", "none"], ["nothing"], strides=[4, 4]),
        helper.make_node("Add", ["nothing", "extent"], ["wh"]),
        helper.make_node("Add", ["nothing", "shift"], ["offset"]),
    ]
    weights = [
        numpy_helper.from_array(red, "red"),
        numpy_helper.from_array(np.zeros((2, 3, 4, 4), np.float32), "none"),
        numpy_helper.from_array(extent, "extent"),
        numpy_helper.from_array(offset, "shift"),
    ]
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, side, side])
    shapes = {"heat": 1, "wh": 2, "offset": 2}
    ports = [
        helper.make_tensor_value_info(n, TensorProto.FLOAT, [1, c, small, small])
        for n, c in shapes.items()
    ]
    return _written(path, helper.make_graph(nodes, "pooling", [picture], ports, weights))


def sized(path: Path, kind: int) -> Path:
    """RT-DETR as its authors export it: the size that boxes are told in is a second input.

    One person fills the middle quarter of the picture.

    Args:
        path: Where to write it.
        kind: Of that input's numbers, ONNX's.
    """
    weights = {
        "boxes_zero": np.zeros((1, 1, 1), np.float32),
        "rows_zero": np.zeros((1, 6), np.float32),
        "three": np.ones(3, np.int64),
        "two": np.ones(2, np.int64),
        "four": np.array([1, 1, 4], np.int64),
        "shares": np.tile(np.array([0.25, 0.25, 0.75, 0.75], np.float32), (1, 6, 1)),
        "score": np.array([[0.9, 0.1, 0.0, 0.0, 0.0, 0.0]], np.float32),
        "label": np.array([[0.0, 3.0, 3.0, 3.0, 3.0, 3.0]], np.float32),
    }
    node = helper.make_node
    nodes = [
        node("ReduceMean", ["images"], ["mean"], keepdims=1, axes=[1, 2, 3]),
        node("Reshape", ["mean", "three"], ["mean_3"]),
        node("Mul", ["mean_3", "boxes_zero"], ["nothing_3"]),
        node("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
        node("Concat", ["size", "size"], ["size_twice"], axis=1),
        node("Reshape", ["size_twice", "four"], ["factors"]),
        node("Mul", ["shares", "factors"], ["pixels"]),
        node("Add", ["pixels", "nothing_3"], ["boxes"]),
        node("Reshape", ["mean", "two"], ["mean_2"]),
        node("Mul", ["mean_2", "rows_zero"], ["nothing_2"]),
        node("Add", ["score", "nothing_2"], ["scores"]),
        node("Add", ["label", "nothing_2"], ["labels"]),
    ]
    value = helper.make_tensor_value_info
    inputs = [
        value("images", TensorProto.FLOAT, [1, 3, 64, 64]),
        value("orig_target_sizes", kind, [1, 2]),
    ]
    shapes = {"labels": [1, 6], "boxes": [1, 6, 4], "scores": [1, 6]}
    outputs = [value(name, TensorProto.FLOAT, shape) for name, shape in shapes.items()]
    tensors = [numpy_helper.from_array(values, name) for name, values in weights.items()]
    return _written(path, helper.make_graph(nodes, "sized", inputs, outputs, tensors))


def _written(path: Path, graph: onnx.GraphProto) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


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


GRAPH, WEIGHTS, LICENCE = "package/tiny.json", "package/tiny.bin", "package/LICENSE"


def files() -> dict[str, bytes]:
    """A package of a tiny detector."""
    made = detector()
    return {
        "package/other.bin": bytes(1000),
        GRAPH: json.dumps(made.model).encode(),
        WEIGHTS: made.weights,
        LICENCE: b"Do what you like.\n",
    }


def source_of(content: dict[str, bytes]) -> Source:
    return Source(
        name="tiny",
        package="tiny-models",
        version="1.2.3",
        package_bytes=100_000,
        graph=GRAPH,
        graph_sha256=hashlib.sha256(content[GRAPH]).hexdigest(),
        weights=WEIGHTS,
        weights_sha256=hashlib.sha256(content[WEIGHTS]).hexdigest(),
        package_licence=LICENCE,
        licence="Apache-2.0",
        notice="Tiny, by its makers.\n",
        outputs=OUTPUTS,
        metadata={"input_side": "96", "pixel_values": "imagenet_bgr"},
    )


Npm = Callable[[str], None]
"""Puts a program ``npm`` on the path that does what is written, in Python."""


def package(path: Path, content: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w:gz") as packed:
        for name, data in content.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            packed.addfile(member, io.BytesIO(data))
    return path


def giving(path: Path) -> str:
    return (
        "where = sys.argv[sys.argv.index('--pack-destination') + 1]\n"
        f"assert sys.argv[1:3] == ['pack', 'tiny-models@1.2.3'], sys.argv\n"
        f"shutil.copy({str(path)!r}, os.path.join(where, 'tiny-models-1.2.3.tgz'))"
    )

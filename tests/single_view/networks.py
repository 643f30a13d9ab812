"""Small ONNX networks with known answers: what they find depends on one patch of the picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from numpy import ndarray
from onnx import TensorProto, helper, numpy_helper

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

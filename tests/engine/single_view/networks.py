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


def _written(path: Path, graph: onnx.GraphProto) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path

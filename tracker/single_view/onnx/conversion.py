"""Conversion of a TensorFlow.js graph model to ONNX, for the networks that this project fetches.

A graph model is a JSON file with the operations (TensorFlow's ``GraphDef``) and the table of the
weights, and a binary file with their values, which may be stored as float16. Only the operations
of an image detector without control flow are converted. TensorFlow orders an image as (batch,
height, width, channels) inside convolutions; ONNX as (batch, channels, height, width). Here every
image stays in the order of ONNX, and a transposition between the two only changes how the
dimensions are named. Nodes of constants are computed, since OpenCV cannot run all of them. Height
and width of the input are left open: a resize becomes a factor, and a reshape infers the number of
cells.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np
from numpy import ndarray

OPSET, IR_VERSION = 13, 8
"""Versions of ONNX's operators and file format: old enough for OpenCV 4.10."""

_TO_CHANNELS_LAST, _TO_CHANNELS_FIRST = [0, 2, 3, 1], [0, 3, 1, 2]


@dataclass(slots=True)
class _Tensor:
    """A tensor of the graph that is not constant."""

    name: str
    """Its name in the ONNX graph."""
    shape: tuple[int, ...]
    """Its shape in ONNX's order, for an input of the size that the graph was traced with."""
    channels_last: bool = False
    """Whether TensorFlow names its dimensions as (batch, height, width, channels)."""
    pads: tuple[int, int, int, int] = (0, 0, 0, 0)
    """Top, left, bottom and right border that the next convolution or pooling adds."""
    outside: float = 0.0
    """The value of that border: 0 for a convolution, -infinity for a pooling."""


@dataclass(slots=True)
class _Graph:
    """The ONNX graph so far."""

    nodes: list[Any] = field(default_factory=list)
    weights: dict[str, ndarray] = field(default_factory=dict)
    tensors: dict[str, _Tensor] = field(default_factory=dict)
    constants: dict[str, ndarray] = field(default_factory=dict)
    convolutions: dict[str, Any] = field(default_factory=dict)
    """The nodes of convolutions without bias, by the name of the output."""


def converted(
    model: Mapping[str, Any],
    weights: bytes,
    outputs: Mapping[str, str],
    metadata: Mapping[str, str],
) -> bytes:
    """Convert a graph model with one image as input.

    Args:
        model: The content of ``model.json``.
        weights: The content of the binary files that it names, one after the other.
        outputs: For each output of the ONNX model, in order, the name of the graph's node.
        metadata: Entries of the ONNX model's ``metadata_props``.

    Returns:
        The ONNX model, with open height and width.

    Raises:
        ValueError: If the graph has an operation or a shape that is not converted, or the weights
            have another length than the table says.
        ImportError: If the library ``onnx`` is not installed.
    """
    from onnx import TensorProto, checker, helper, numpy_helper

    graph = _Graph(constants=_constants(model, weights))
    picture = ""
    for node in _in_order(model["modelTopology"]["node"]):
        if node["op"] == "Placeholder":
            picture = node["name"]
            shape = tuple(int(d["size"]) for d in node["attr"]["shape"]["shape"]["dim"])
            graph.tensors[picture] = _Tensor(picture, shape)
        elif node["op"] != "Const":
            _convert(graph, node)
    if not picture:
        raise ValueError("the graph has no input")
    ports = []
    for name, source in outputs.items():
        tensor = graph.tensors[source]
        graph.nodes.append(helper.make_node("Identity", [tensor.name], [name]))
        open_shape = [1, None, *tensor.shape[2:]]
        ports.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, open_shape))
    shape = graph.tensors[picture].shape
    images = helper.make_tensor_value_info(
        picture, TensorProto.FLOAT, [shape[0], shape[1], "height", "width"]
    )
    tensors = [numpy_helper.from_array(values, name) for name, values in graph.weights.items()]
    made = helper.make_model(
        helper.make_graph(graph.nodes, "converted", [images], ports, tensors),
        opset_imports=[helper.make_opsetid("", OPSET)],
    )
    made.ir_version = IR_VERSION
    helper.set_model_props(made, dict(metadata))
    checker.check_model(made)
    return bytes(made.SerializeToString())


def _constants(model: Mapping[str, Any], weights: bytes) -> dict[str, ndarray]:
    """Read the table of the weights: the values of each constant by name.

    Raises:
        ValueError: If the file has another length than the table says, or an unknown type.
    """
    found: dict[str, ndarray] = {}
    place = 0
    for entry in (entry for group in model["weightsManifest"] for entry in group["weights"]):
        stored = entry.get("quantization", {}).get("dtype", entry["dtype"])
        if stored not in ("float16", "float32", "int32"):
            raise ValueError(f"weights of type {stored} are not read")
        kind = np.dtype(stored).newbyteorder("<")
        count = int(np.prod(entry["shape"], dtype=np.int64))
        size = count * kind.itemsize
        if place + size > len(weights):
            raise ValueError(f"the weights end early: {len(weights)} bytes")
        values = np.frombuffer(weights, kind, count, place).reshape(entry["shape"])
        found[entry["name"]] = values.astype(np.int64 if stored == "int32" else np.float32)
        place += size
    if place != len(weights):
        raise ValueError(f"expected {place} bytes of weights, found {len(weights)}")
    return found


def _in_order(nodes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sort nodes so that each comes after its inputs."""
    by_name = {node["name"]: node for node in nodes}
    inputs = {name: [*map(_source, node.get("input", []))] for name, node in by_name.items()}
    try:
        return [by_name[name] for name in TopologicalSorter(inputs).static_order()]
    except CycleError as error:
        raise ValueError("the graph has a circle") from error


def _source(name: str) -> str:
    """The name of the node behind the name of an input, ``node`` or ``node:1``."""
    return name.partition(":")[0]


def _convert(graph: _Graph, node: Mapping[str, Any]) -> None:
    """Convert one node, with inputs that are converted already."""
    name, kind = node["name"], node["op"]
    inputs = [i.removesuffix(":0") for i in node.get("input", [])]
    given = [graph.constants[i] for i in inputs if i in graph.constants]
    if len(given) == len(inputs):
        graph.constants[name] = _folded(kind, given)
        return
    tensor = graph.tensors.get(inputs[0])
    if tensor is None:
        raise ValueError(f"{kind} with a constant as its first input is not converted")
    if tensor.pads != (0, 0, 0, 0) and kind not in ("Conv2D", "MaxPool", "Transpose"):
        raise ValueError(f"{kind} of an image with a border is not converted")
    attributes = node.get("attr", {})
    match kind:
        case "Identity":
            graph.tensors[name] = tensor
        case "Transpose":
            _transpose(graph, name, tensor, given[0].tolist())
        case "Pad" | "PadV2":
            _pad(graph, name, tensor, given)
        case "Conv2D":
            _convolution(graph, name, tensor, given[0], attributes)
        case "MaxPool":
            _pooling(graph, name, tensor, attributes)
        case "Add" | "AddV2":
            other = graph.tensors.get(inputs[1])
            if other is not None:
                _sum(graph, name, tensor, other)
            else:
                _bias(graph, name, tensor, given[0])
        case "LeakyRelu":
            slope = float(attributes.get("alpha", {}).get("f", 0.2))  # TensorFlow's default
            _node(graph, "LeakyRelu", name, [tensor], tensor.shape, tensor, alpha=slope)
        case "Sigmoid":
            _node(graph, "Sigmoid", name, [tensor], tensor.shape, tensor)
        case "ConcatV2":
            _concatenation(graph, name, [graph.tensors[i] for i in inputs[:-1]], int(given[-1]))
        case "SplitV":
            _split(graph, name, tensor, given[0], int(given[1]))
        case "ResizeBilinear":
            _resize(graph, name, tensor, given[0], attributes)
        case "Reshape":
            _reshape(graph, name, tensor, given[0])
        case _:
            raise ValueError(f"the operation {kind} is not converted")


def _folded(kind: str, given: list[ndarray]) -> ndarray:
    """Compute a node whose inputs are all constant."""
    match kind:
        case "Identity":
            return given[0]
        case "Add" | "AddV2":
            return np.asarray(given[0] + given[1])
        case "SparseToDense":
            places, shape, values, otherwise = given
            dense = np.full(tuple(shape.tolist()), otherwise)
            if len(places):
                dense[tuple(places.reshape(len(places), -1).T)] = values
            return dense
        case _:
            raise ValueError(f"the operation {kind} of constants is not converted")


def _node(
    graph: _Graph,
    kind: str,
    name: str,
    inputs: Sequence[_Tensor | str],
    shape: tuple[int, ...],
    like: _Tensor,
    **attributes: Any,
) -> None:
    """Add a node with one output whose dimensions are named as those of ``like``."""
    from onnx import helper

    names = [i if isinstance(i, str) else i.name for i in inputs]
    for used in names:
        graph.convolutions.pop(used, None)  # what is used without its bias gets none any more
    graph.nodes.append(helper.make_node(kind, names, [name], **attributes))
    graph.tensors[name] = _Tensor(name, shape, like.channels_last)


def _axis(tensor: _Tensor, axis: int) -> int:
    """The dimension of ONNX's order that TensorFlow calls ``axis``."""
    axis %= len(tensor.shape)
    return _TO_CHANNELS_LAST[axis] if tensor.channels_last else axis


def _transpose(graph: _Graph, name: str, tensor: _Tensor, order: list[int]) -> None:
    if len(order) == 4:
        expected = _TO_CHANNELS_FIRST if tensor.channels_last else _TO_CHANNELS_LAST
        if order != expected:
            raise ValueError(f"the transposition {order} of an image is not converted")
        graph.tensors[name] = _Tensor(
            tensor.name, tensor.shape, not tensor.channels_last, tensor.pads, tensor.outside
        )
        return
    shape = tuple(tensor.shape[i] for i in order)
    _node(graph, "Transpose", name, [tensor], shape, tensor, perm=order)


def _pad(graph: _Graph, name: str, tensor: _Tensor, given: list[ndarray]) -> None:
    borders = given[0][_TO_CHANNELS_FIRST] if tensor.channels_last else given[0]
    if borders[:2].any():
        raise ValueError("only borders of height and width are converted")
    outside = float(given[1]) if len(given) > 1 else 0.0
    (top, bottom), (left, right) = borders[2:].tolist()
    graph.tensors[name] = _Tensor(
        tensor.name, tensor.shape, tensor.channels_last, (top, left, bottom, right), outside
    )


def _text(attribute: Mapping[str, Any]) -> str:
    return base64.b64decode(attribute["s"]).decode()


def _window(
    tensor: _Tensor, size: Sequence[int], attributes: Mapping[str, Any], outside: float
) -> tuple[list[int], tuple[int, int]]:
    """The strides and the resulting height and width of a window that slides over an image.

    Raises:
        ValueError: If the window does not slide as it is converted here.
    """
    valid = _text(attributes["padding"]) == "VALID" and _text(attributes["data_format"]) == "NHWC"
    dilations = attributes.get("dilations", {}).get("list", {}).get("i", ["1"])
    plain = {int(d) for d in dilations} == {1}
    bordered = any(tensor.pads)
    if not (valid and plain and tensor.channels_last) or (bordered and tensor.outside != outside):
        raise ValueError("only windows over (batch, height, width, channels) are converted")
    strides = [int(i) for i in attributes["strides"]["list"]["i"]][1:3]
    top, left, bottom, right = tensor.pads
    height = (tensor.shape[2] + top + bottom - size[0]) // strides[0] + 1
    width = (tensor.shape[3] + left + right - size[1]) // strides[1] + 1
    return strides, (height, width)


def _convolution(
    graph: _Graph, name: str, tensor: _Tensor, kernel: ndarray, attributes: Mapping[str, Any]
) -> None:
    size = kernel.shape[:2]
    strides, out = _window(tensor, size, attributes, 0.0)
    graph.weights[f"{name}/kernel"] = np.ascontiguousarray(kernel.transpose(3, 2, 0, 1))
    _node(
        graph, "Conv", name, [tensor, f"{name}/kernel"], (1, kernel.shape[3], *out), tensor,
        kernel_shape=list(size), strides=strides, pads=list(tensor.pads),
    )  # fmt: skip
    graph.convolutions[name] = graph.nodes[-1]


def _pooling(graph: _Graph, name: str, tensor: _Tensor, attributes: Mapping[str, Any]) -> None:
    size = [int(i) for i in attributes["ksize"]["list"]["i"]][1:3]
    strides, out = _window(tensor, size, attributes, -np.inf)
    _node(
        graph, "MaxPool", name, [tensor], (1, tensor.shape[1], *out), tensor,
        kernel_shape=size, strides=strides, pads=list(tensor.pads),
    )  # fmt: skip


def _sum(graph: _Graph, name: str, first: _Tensor, second: _Tensor) -> None:
    if first.shape != second.shape or first.channels_last != second.channels_last:
        raise ValueError("a sum of tensors of different shapes is not converted")
    _node(graph, "Add", name, [first, second], first.shape, first)


def _bias(graph: _Graph, name: str, tensor: _Tensor, values: ndarray) -> None:
    """Add a value to each channel: as part of the convolution before it."""
    convolution = graph.convolutions.pop(tensor.name, None)
    by_channel = values.shape[-1:] == (values.size,) == (tensor.shape[1],)
    if convolution is None or not tensor.channels_last or not by_channel:
        raise ValueError("only a value for each channel of a convolution is added")
    graph.weights[f"{name}/bias"] = values.reshape(-1)
    convolution.input.append(f"{name}/bias")
    graph.tensors[name] = tensor


def _concatenation(graph: _Graph, name: str, parts: list[_Tensor], axis: int) -> None:
    first = parts[0]
    if any(part.channels_last != first.channels_last for part in parts):
        raise ValueError("a concatenation of images in different orders is not converted")
    axis = _axis(first, axis)
    shape = list(first.shape)
    shape[axis] = sum(part.shape[axis] for part in parts)
    _node(graph, "Concat", name, parts, tuple(shape), first, axis=axis)


def _split(graph: _Graph, name: str, tensor: _Tensor, sizes: ndarray, axis: int) -> None:
    from onnx import helper

    axis = _axis(tensor, axis)
    names = [name, *(f"{name}:{i}" for i in range(1, len(sizes)))]
    graph.weights[f"{name}/sizes"] = sizes
    graph.nodes.append(helper.make_node("Split", [tensor.name, f"{name}/sizes"], names, axis=axis))
    for part, size in zip(names, sizes.tolist(), strict=True):
        shape = list(tensor.shape)
        shape[axis] = size
        graph.tensors[part] = _Tensor(part, tuple(shape), tensor.channels_last)


def _resize(
    graph: _Graph, name: str, tensor: _Tensor, size: ndarray, attributes: Mapping[str, Any]
) -> None:
    if not attributes["half_pixel_centers"]["b"] or not tensor.channels_last:
        raise ValueError("only a resize between the centres of pixels is converted")
    height, width = (int(s) for s in size)
    factors = [1.0, 1.0, height / tensor.shape[2], width / tensor.shape[3]]
    graph.weights[f"{name}/factors"] = np.array(factors, np.float32)
    shape = (*tensor.shape[:2], height, width)
    _node(
        graph, "Resize", name, [tensor, "", f"{name}/factors"], shape, tensor,
        mode="linear", coordinate_transformation_mode="half_pixel",
    )  # fmt: skip


def _reshape(graph: _Graph, name: str, tensor: _Tensor, shape: ndarray) -> None:
    """Join height and width: (1, C, h, w) → (1, C, h w)."""
    joined = (*tensor.shape[:2], tensor.shape[2] * tensor.shape[3])
    wanted = tuple(shape.tolist())
    known = [own for asked, own in zip(wanted, joined, strict=False) if asked == -1]
    resolved = tuple(known[0] if asked == -1 and known else asked for asked in wanted)
    if tensor.channels_last or resolved != joined:
        raise ValueError(f"the reshape of {tensor.shape} to {wanted} is not converted")
    graph.weights[f"{name}/shape"] = np.array([*joined[:2], -1], np.int64)
    _node(graph, "Reshape", name, [tensor, f"{name}/shape"], joined, tensor)

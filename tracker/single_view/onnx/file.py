"""Reader of an ONNX file's inputs and outputs: names, shapes and data types.

OpenCV reads the network without exposing these. The file is a Protocol Buffers message
(onnx.proto3 of ONNX; encoding: "Encoding" of the Protocol Buffers documentation), of which
only the few fields that are needed are parsed here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_GRAPH, _METADATA = 7, 14
_INITIALIZER, _INPUT, _OUTPUT = 5, 11, 12
_TENSOR_NAME = 8
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5

UINT8, INT64 = 2, 7
"""Data types, of ONNX's ``TensorProto.DataType``."""


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of the network."""

    name: str
    """Name of the input or output."""
    kind: int
    """Data type, of ONNX's ``TensorProto.DataType``."""
    shape: tuple[int, ...]
    """Size of each dimension, 0 for a variable one."""


@dataclass(frozen=True, slots=True)
class Ports:
    """The inputs that are not weights of the network, its outputs, and the file's metadata."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: Mapping[str, str]
    """The ``metadata_props``: texts by key."""


def ports_of(data: bytes) -> Ports:
    """Read the inputs and outputs of a model.

    Raises:
        ValueError: If the data are no ONNX model.
    """
    try:
        parts = list(_fields(memoryview(data)))
        graph = next(value for field, value in parts if field == _GRAPH)
        metadata = dict(_entry(_message(value)) for field, value in parts if field == _METADATA)
        inputs, outputs, weights = [], [], set()
        for field, value in _fields(_message(graph)):
            if field == _INPUT:
                inputs.append(_port(_message(value)))
            elif field == _OUTPUT:
                outputs.append(_port(_message(value)))
            elif field == _INITIALIZER:
                weights |= {_text(v) for f, v in _fields(_message(value)) if f == _TENSOR_NAME}
    except (StopIteration, IndexError, UnicodeDecodeError, TypeError) as error:
        raise ValueError("it is not an ONNX model") from error
    if not inputs or not outputs:
        raise ValueError("it is an ONNX model without inputs or outputs")
    return Ports(tuple(p for p in inputs if p.name not in weights), tuple(outputs), metadata)


def _fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield number and value of each field of a message in the encoding of Protocol Buffers."""
    place = 0
    while place < len(message):
        tag, place = _varint(message, place)
        kind = tag & 7
        if kind == _VARINT:
            value, place = _varint(message, place)
            yield tag >> 3, value
        elif kind == _BYTES:
            size, place = _varint(message, place)
            if place + size > len(message):
                raise IndexError
            yield tag >> 3, message[place : place + size]
            place += size
        elif kind in (_FIXED32, _FIXED64):
            place += 4 if kind == _FIXED32 else 8
        else:
            raise IndexError


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[place]
        value |= (byte & 0x7F) << shift
        place, shift = place + 1, shift + 7
        if byte < 0x80:
            return value, place
        if shift > 63:
            raise IndexError


def _message(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise TypeError
    return value


def _text(value: int | memoryview) -> str:
    return bytes(_message(value)).decode()


def _entry(message: memoryview) -> tuple[str, str]:
    """Read a ``StringStringEntryProto``: key 1, value 2."""
    fields = dict(_fields(message))
    return _text(fields.get(1, memoryview(b""))), _text(fields.get(2, memoryview(b"")))


def _port(message: memoryview) -> Port:
    """Read a ``ValueInfoProto``: name 1, type 2 { tensor 1 { type 1, shape 2 { size 1 } } }."""
    name, kind, shape = "", 0, []
    for field, value in _fields(message):
        if field == 1:
            name = _text(value)
        elif field == 2:
            for tensor_field, tensor in _fields(_message(value)):
                if tensor_field != 1:
                    continue
                for part, inner in _fields(_message(tensor)):
                    if part == 1 and isinstance(inner, int):
                        kind = inner
                    elif part == 2:
                        shape = [_size(_message(v)) for f, v in _fields(_message(inner)) if f == 1]
    return Port(name, kind, tuple(shape))


def _size(dimension: memoryview) -> int:
    """The size of a dimension; 0 for a named one."""
    for field, value in _fields(dimension):
        if field == 1 and isinstance(value, int):
            return value if value < 1 << 62 else 0
    return 0

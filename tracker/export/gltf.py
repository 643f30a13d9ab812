"""glTF 2.0 in one binary file: a moving upright box for each person, and the room's floor.

Each track is a node with its id as name and the colour that it has on the page. The node's
animation moves the box and sets its scale to 1 while the track exists and to 0 in gaps. The
scene's root rotates the world's z axis onto glTF's y axis. Source: Khronos Group, "glTF 2.0
Specification", 2021.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from tracker import __version__
from tracker.export.exported_run import ExportedRun, Options
from tracker.export.palette import rgb

_FLOAT, _UINT = 5126, 5125
"""The types float32 and uint32 of an accessor's numbers."""

_ARRAY, _ELEMENTS = 34962, 34963
"""The kinds of buffers: attributes of vertices, and indices of vertices."""

_TURN = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""The rotation by −90° about x, which maps the world's z axis onto y, as the quaternion x, y, z,
w."""


class _Buffer:
    """The binary chunk of the file, with its buffer views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: ndarray, *, target: int | None = None, bounds: bool = False) -> int:
        """Append an array and return the index of its accessor.

        Args:
            values: Numbers of shape (N,), or vectors of shape (N, 3).
            target: The kind of buffer for the graphics card, :data:`_ARRAY` or :data:`_ELEMENTS`;
                None for animations.
            bounds: Whether the accessor states the least and the largest value of each column.
        """
        floats = values.dtype.kind == "f"
        data = values.astype(np.float32 if floats else np.uint32)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": data.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.data += data.tobytes()
        shape = {1: "SCALAR", 3: "VEC3"}[data.shape[1] if data.ndim == 2 else 1]
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": _FLOAT if floats else _UINT,
            "count": len(data),
            "type": shape,
        }
        if bounds:
            flat = data.reshape(len(data), -1)
            accessor |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as binary glTF, track by track."""
    sequence, ids = run.sequence, run.ids
    buffer = _Buffer()
    box = _box(buffer, sequence.target_half_extents)
    room = sequence.room
    corners = [(x, y) for x in (0, 1) for y in (0, 1)]
    bounds = np.array([room.minimum, room.maximum])
    floor = np.array([[bounds[x, 0], bounds[y, 1], room.minimum[2]] for x, y in corners])
    floor_mesh = {
        "attributes": {"POSITION": buffer.add(floor, target=_ARRAY, bounds=True)},
        "indices": buffer.add(np.array([0, 2, 1, 1, 2, 3]), target=_ELEMENTS),
        "material": 0,
    }
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"multiview-phd {__version__}"},
        "scene": 0,
        "scenes": [{"name": sequence.name, "nodes": [0]}],
        "nodes": [
            {"name": "world", "rotation": _TURN, "children": list(range(1, len(ids) + 2))},
            {"name": "floor", "mesh": 0},
        ],
        "materials": [_material("floor", (110, 110, 110))],
        "meshes": [{"name": "floor", "primitives": [floor_mesh]}],
    }
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for done, number in enumerate(ids):
        options.at(done, len(ids))
        document["materials"].append(_material(f"track {number}", rgb(number)))
        primitive = {**box, "material": len(document["materials"]) - 1}
        document["meshes"].append({"name": f"track {number}", "primitives": [primitive]})
        rows = np.flatnonzero(run.tracks.ids == number)
        places = run.tracks.positions[rows]
        document["nodes"].append(
            {
                "name": f"track {number}",
                "mesh": len(document["meshes"]) - 1,
                "translation": places[0].tolist(),
            }
        )
        node = len(document["nodes"]) - 1
        frames = run.tracks.frames[rows]
        shown, there = _presence(frames, run.steps)
        for name, times, values, way in (
            ("translation", frames, places, "LINEAR"),
            ("scale", shown, np.repeat(there[:, None], 3, axis=1), "STEP"),
        ):
            moments = buffer.add(times * sequence.step_time, bounds=True)
            samplers.append({"input": moments, "output": buffer.add(values), "interpolation": way})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": name}})
    if channels:
        document["animations"] = [{"name": "tracks", "samplers": samplers, "channels": channels}]
    document["buffers"] = [{"byteLength": len(buffer.data)}]
    document["bufferViews"], document["accessors"] = buffer.views, buffer.accessors
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(buffer.data) + b"\0" * (-len(buffer.data) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)
    options.at(len(ids), len(ids))


def _presence(frames: ndarray, steps: int) -> tuple[ndarray, ndarray]:
    """Return the steps at which a track appears or disappears, beginning with step 0, and whether
    it exists from each of them on (1.0 or 0.0)."""
    there = np.zeros(steps + 1)
    there[frames] = 1.0
    turns = np.flatnonzero(np.diff(there[:steps], prepend=-1.0))
    return turns, there[turns]


def _material(name: str, colour: tuple[int, int, int]) -> dict[str, Any]:
    """Return a dull material.

    Args:
        name: The name of the material.
        colour: Red, green and blue in 0 … 255, with a gamma of about 2.2; glTF has linear colours.
    """
    linear = [(value / 255.0) ** 2.2 for value in colour]
    return {
        "name": name,
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.9,
        },
    }


def _box(buffer: _Buffer, half: ndarray) -> dict[str, Any]:
    """Return the primitive of a box around the origin with constant normals on each face.

    Args:
        buffer: The buffer to which the vertices are added.
        half: Half width, depth and height of the box, metres.
    """
    points: list[ndarray] = []
    normals: list[ndarray] = []
    faces: list[int] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u, v = np.roll(np.eye(3), -(axis + 1), axis=0)[:2]
            first = len(points)
            points += [(normal + a * u + b * v) * half for a in (-1, 1) for b in (-1, 1)]
            normals += [normal] * 4
            order = (0, 2, 1, 1, 2, 3) if sign > 0 else (0, 1, 2, 2, 1, 3)
            faces += [first + k for k in order]
    return {
        "attributes": {
            "POSITION": buffer.add(np.array(points), target=_ARRAY, bounds=True),
            "NORMAL": buffer.add(np.array(normals), target=_ARRAY),
        },
        "indices": buffer.add(np.array(faces), target=_ELEMENTS),
    }

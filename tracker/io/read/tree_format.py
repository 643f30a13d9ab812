"""A calibration format that is declared: where the fields of a camera lie in a tree, in what form.

The tree is that of JSON, YAML, TOML or XML, or what a function makes of any other file.

A format names the path to its cameras and, for each part of a camera, where it lies; recognising,
reading and wording errors is done here. Paths are keys with ``/`` between them; ``*`` stands for
every field of a table or every element of a list, ``.`` for the whole file, ``|`` for "or". An
attribute of XML is a field like a child.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any, ClassVar, Literal

import numpy as np

from tracker.files.text import shown
from tracker.io.read import values
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import TEXT, SourceFile

Syntax = Literal["json", "yaml", "toml", "xml"] | Callable[[SourceFile], Any]
"""How a file becomes a tree. A function returns None for a file that is read with another one."""


def at(value: Any, path: str) -> Any:
    """Return what lies at a path in a tree; None where there is nothing."""
    for step in path.split("/"):
        if isinstance(value, list) and step.isdigit():
            value = value[int(step)] if int(step) < len(value) else None
        else:
            value = value.get(step) if isinstance(value, Mapping) else None
    return value.get(TEXT, value) if isinstance(value, Mapping) else value


@dataclass(frozen=True, slots=True)
class Node:
    """The table of one camera in the tree of a file."""

    file: SourceFile
    value: Any
    key: str = ""
    """The key of the table, or its place in a list; empty for the whole file."""
    place: int = 0
    """The number of cameras before this one in the file."""

    def find(self, path: str) -> Any:
        """Return what lies at a path; None where there is nothing."""
        return at(self.value, path)

    def get(self, path: str) -> Any:
        """Return what lies at a path.

        Raises:
            FormatError: If there is nothing.
        """
        value = self.find(path)
        if value is None:
            raise self.file.error(f"expected the field {path}, which is missing", self.key)
        return value

    def where(self, path: str) -> str:
        """Return the name of a field in messages."""
        return f"{self.key}.{path}" if self.key else path


Part = Callable[[Node], Mapping[str, Any]]
"""Reads some fields of a :class:`RawCamera` from a camera's table."""


@dataclass(frozen=True, slots=True)
class TreeFormat:
    """Cameras in a tree of named fields, recognised where a camera has all required paths."""

    KIND: ClassVar[Kind] = "calibration"
    SERIES: ClassVar[bool] = False

    NAME: str
    syntax: Syntax
    cameras: str | Callable[[Any], Iterable[tuple[str, Any]]]
    """The path to one camera; or a function that puts the tables of the cameras together from the
    tree of the file, each with a key."""
    required: tuple[str, ...]
    """Paths in a camera's table. A table that has none of them is no camera's."""
    parts: tuple[Part, ...]
    convention: Convention = field(default_factory=Convention)
    marks: tuple[str, ...] | Callable[[SourceFile], bool] = ()
    """Words in the beginning of a file that state the format, or a function that finds out whether
    a file has it; none if its fields do."""
    most: int | None = None
    """The largest number of cameras of a rig that stands still; None for any."""
    choose: Callable[[list[Node]], list[Node]] = list
    """Which cameras of a file are wanted."""

    def recognise(self, file: SourceFile) -> Certainty:
        """The marks in the beginning; or a camera with every required field."""
        head = file.head_text
        if callable(self.marks):
            return Certainty.SURE if self.marks(file) else Certainty.NO
        if self.marks:
            return Certainty.SURE if all(mark in head for mark in self.marks) else Certainty.NO
        steps = {step for path in self.required for step in path.split("/")}
        sign = '"' if self.syntax == "json" else ""
        if not all(f"{sign}{step}{sign}" in head or step.isdigit() for step in steps):
            return Certainty.NO
        starts = {"json": ("{", "["), "xml": ("<",)}.get(str(self.syntax))
        if starts is not None and head.lstrip()[:1] not in starts:
            return Certainty.NO
        nodes = self._nodes(file, self._tree(file))
        whole = any(all(node.find(path) is not None for path in self.required) for node in nodes)
        return Certainty.SURE if whole else Certainty.NO

    def read(self, file: SourceFile) -> Iterator[Piece]:
        """One piece with every camera of the file; none if it is read with another file."""
        tree = self._tree(file)
        if tree is None and callable(self.syntax):
            return
        found = []
        pose = np.eye(4)
        nodes = self.choose(self._nodes(file, tree))
        if self.most is not None and not 1 <= len(nodes) <= self.most:
            raise file.error(
                f"has {len(nodes)} posed pictures, expected one a camera that stands still, from 1 "
                f"to {self.most}; leave out the others, or reconstruct one moment"
            )
        for node in nodes:
            missing = [path for path in self.required if node.find(path) is None]
            if missing:
                raise file.error(
                    f"expected the fields {', '.join(missing)}, which are missing", node.key
                )
            fields: dict[str, Any] = {"name": "", "convention": self.convention}
            for part in self.parts:
                fields |= part(node)
            step = fields.pop("step", None)
            if step is not None:
                pose = step @ pose
                fields |= {"rotation": pose[:3, :3], "translation": pose[:3, 3]}
            found.append(RawCamera(**fields))
        yield CalibrationPiece(file.path, self.NAME, tuple(found))

    def _tree(self, file: SourceFile) -> Any:
        if callable(self.syntax):
            return self.syntax(file)
        return file.xml_tree if self.syntax == "xml" else getattr(file, self.syntax)

    def _nodes(self, file: SourceFile, tree: Any) -> list[Node]:
        """The tables at the path to a camera that have any of the required fields."""
        found: list[Node] = []
        if not isinstance(self.cameras, str):
            rows = self.cameras(tree)
            return [Node(file, value, key, place) for place, (key, value) in enumerate(rows)]
        for path in self.cameras.split("|"):
            for key, value in _matches(tree, path):
                node = Node(file, value, key, len(found))
                if any(node.find(path) is not None for path in self.required):
                    found.append(node)
        return found


def _matches(value: Any, path: str, key: str = "") -> Iterator[tuple[str, Any]]:
    """The values at a path, each with its last key."""
    if path in (".", ""):
        # several children of one name in XML
        several = isinstance(value, list) and all(isinstance(item, dict) for item in value)
        yield from ((str(n), one) for n, one in enumerate(value)) if several else ((key, value),)
        return
    step, _, rest = path.partition("/")
    rows: Any = ()
    if isinstance(value, Mapping):
        rows = value.items()
    elif isinstance(value, list):
        rows = enumerate(value)
    for own, item in rows:
        if step == "*" or str(own) == step:
            yield from _matches(item, rest, str(own))


def name(path: str = "") -> Part:
    """The camera's name, at a path; its key where there is none."""
    return lambda node: {"name": str((path and node.find(path)) or node.key)}


def stem() -> Part:
    """The camera's name: its key is the path of a picture, whose suffix is left out."""
    return lambda node: {"name": PurePosixPath(node.key).with_suffix("").as_posix()}


def image_size(path: str, height: str = "") -> Part:
    """Width and height, at one path or at two; nothing where there is none."""

    def part(node: Node) -> Mapping[str, Any]:
        given = [node.find(path), node.find(height)] if height else node.find(path)
        if given is None or (height and None in given):
            return {}
        where = node.where(f"{path} and {height}" if height else path)
        return {"image_size": values.image_size(node.file, where, given)}

    return part


def number(node: Node, path: str) -> float:
    """The number at a path."""
    return values.number(node.file, node.where(path), node.get(path))


def intrinsics(*paths: str) -> Part:
    """K as a 3×3 matrix at one path, as fx, fy, cx, cy in one list, or at a path each."""

    def part(node: Node) -> Mapping[str, Any]:
        given = node.get(paths[0]) if len(paths) == 1 else [node.get(path) for path in paths]
        where = node.where(paths[0] if len(paths) == 1 else ", ".join(paths))
        if np.size(given) == 4:
            four = values.vector(node.file, where, given, 4, "fx fy cx cy")
            return {"intrinsics": values.focal_and_centre(*four)}
        return {"intrinsics": values.intrinsics(node.file, where, given)}

    return part


def lens(*paths: str, model: str = "", fisheyes: Mapping[Any, bool] | None = None) -> Part:
    """The numbers of a lens in OpenCV's order, in one list or at a path each.

    Args:
        paths: Where they are.
        model: Where the file names the model of the lens.
        fisheyes: Whether each model is one of a fisheye; the first is that of a file that names
            none. One that is called ``none`` has no numbers.
    """

    def part(node: Node) -> Mapping[str, Any]:
        models = dict(fisheyes or {"": False})
        own = node.find(model) if model else None
        own = next(iter(models)) if own is None else own
        if own not in models:
            known = ", ".join(map(str, models))
            raise node.file.error(
                f"expected one of {known}, found {shown(own)}; calibrate with one of those",
                node.where(model),
            )
        given = node.get(paths[0]) if len(paths) == 1 else [node.get(path) for path in paths]
        if own == "none":
            given = []
        where = node.where(", ".join(paths))
        found, kind = values.lens(node.file, where, given, fisheye=models[own])
        return {"distortion": found, "lens": kind}

    return part


def pose(rotation: str, translation: str, *, optional: bool = False) -> Part:
    """A rotation (matrix or vector) and a translation."""

    def part(node: Node) -> Mapping[str, Any]:
        if optional and None in (node.find(rotation), node.find(translation)):
            return {}
        return {
            "rotation": values.rotation(node.file, node.where(rotation), node.get(rotation)),
            "translation": values.vector(
                node.file, node.where(translation), node.get(translation), 3, "x y z"
            ),
        }

    return part


def pose_of_quaternion(path: str) -> Part:
    """A quaternion w x y z and a translation, seven numbers in one list."""

    def part(node: Node) -> Mapping[str, Any]:
        from scipy.spatial.transform import Rotation  # a server starts without it

        what = "quaternion w x y z and translation"
        seven = values.vector(node.file, node.where(path), node.get(path), 7, what)
        turned = Rotation.from_quat(np.roll(seven[:4], -1))
        return {"rotation": np.asarray(turned.as_matrix()), "translation": seven[4:]}

    return part


def pose_at(rotation: str, centre: str) -> Part:
    """A rotation into the camera, and the camera's place C: t = -R C."""
    given = pose(rotation, centre)

    def part(node: Node) -> Mapping[str, Any]:
        turned, place = (given(node)[name] for name in ("rotation", "translation"))
        return {"rotation": turned, "translation": -turned @ place}

    return part


def pose_matrix(path: str, rows: Literal[3, 4] = 4) -> Part:
    """A pose [R | t] of three or four rows."""

    def part(node: Node) -> Mapping[str, Any]:
        found = values.matrix(node.file, node.where(path), node.get(path), rows, 4)
        turned = values.rotation(node.file, node.where(path), found[:3, :3])
        return {"rotation": turned, "translation": found[:3, 3]}

    return part


def step_from_last(path: str) -> Part:
    """A 4×4 pose relative to the camera before; the world is the first camera."""

    def part(node: Node) -> Mapping[str, Any]:
        if node.place == 0:
            return {"step": np.eye(4)}
        found = values.matrix(node.file, node.where(path), node.get(path), 4, 4)
        values.rotation(node.file, node.where(path), found[:3, :3])
        return {"step": found}

    return part


def only(path: str, *known: str) -> Part:
    """Refuse a camera whose field, if it is there, says anything else."""

    def part(node: Node) -> Mapping[str, Any]:
        own = node.find(path)
        if own is not None and own not in known:
            raise node.file.error(
                f"expected {' or '.join(known)}, found {shown(own)}; calibrate with that",
                node.where(path),
            )
        return {}

    return part

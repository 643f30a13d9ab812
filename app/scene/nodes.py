"""The kinds of named nodes that the 3D scene is made of, each made once and updated in place.

viser keeps a message for every name that it has ever seen until the next browser
connects, so nothing here is ever removed: what has nothing to show is hidden, and
what comes in numbers is a batch or a pool that only grows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import viser
from jaxtyping import Float, UInt8
from numpy import ndarray

from app import colours

DISC = 26.0
"""Pixels across, of the disc behind a label of 12 pixels."""

ROOM_FOR = 14
"""Labels of full size; where there are more, all are smaller."""
SMALLEST = 0.6

NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
"""The identity as a unit quaternion w, x, y, z."""


class Lines:
    """A batch of line segments, coloured end by end."""

    def __init__(self, server: viser.ViserServer, name: str, thickness: float) -> None:
        """Make the node, hidden."""
        self._handle = server.scene.add_line_segments(
            name,
            np.zeros((1, 2, 3)),
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )

    @property
    def thickness(self) -> float:
        """Pixels, whatever the distance."""
        return float(self._handle.thickness)

    @thickness.setter
    def thickness(self, pixels: float) -> None:
        self._handle.thickness = pixels

    def show(
        self,
        segments: Float[ndarray, "N 2 3"],
        colour: UInt8[ndarray, "N 2 3"] | colours.Rgb,
    ) -> None:
        """Draw these segments and no others; no rows hide the node."""
        self._handle.visible = len(segments) > 0
        if len(segments) == 0:
            return
        ends = np.broadcast_to(np.asarray(colour, dtype=np.uint8), segments.shape)
        self._handle.points = np.asarray(segments, dtype=np.float32)
        self._handle.colors = linear(ends)


class Meshes:
    """Many copies of one mesh, each with a place, a turn, a size, a colour and an opacity."""

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        vertices: Float[ndarray, "V 3"],
        faces: ndarray,
        *,
        side: Literal["back", "double"] = "double",
        opacity: float | None = None,
        on_click: Callable[[int], None] | None = None,
    ) -> None:
        """Make the node, hidden.

        Args:
            server: Where the node lives.
            name: Of the node.
            vertices: Of the mesh, its own units.
            faces: Triangles of indices, outward.
            side: Which side of them is drawn. The copies write depth though one sees through
                them, unless the ``back`` alone is drawn: these hide nothing
                (:data:`app.web.access.gateway.BACKS_WRITE_NO_DEPTH`).
            opacity: Of all copies; without it each has its own. Where it is another one, the
                client makes the whole node anew, and draws it after those made before, of all
                whose places are alike.
            on_click: Called with the index of the copy that was clicked.
        """
        self._handle = server.scene.add_batched_meshes_simple(
            name,
            vertices,
            faces,
            batched_wxyzs=NO_TURN[None],
            batched_positions=np.zeros((1, 3)),
            batched_scales=np.ones((1, 3)),
            batched_colors=np.zeros((1, 3), dtype=np.uint8),
            opacity=opacity,
            batched_opacities=np.zeros(1) if opacity is None else None,
            lod="off",
            side=side,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        if on_click is not None:
            self._handle.on_click(passing(on_click))

    def show(
        self,
        positions: Float[ndarray, "N 3"],
        scales: Float[ndarray, "N 3"],
        colour: UInt8[ndarray, "N 3"],
        opacities: Float[ndarray, " N"] | None = None,
        wxyzs: Float[ndarray, "N 4"] | None = None,
        *,
        about: Float[ndarray, " 3"] | None = None,
    ) -> None:
        """Draw these copies and no others; no rows hide the node.

        Args:
            positions: World metres.
            scales: Along the axes of the mesh.
            colour: Red, green, blue, 0 … 255.
            opacities: 0 … 1, where each copy has its own.
            wxyzs: Unit quaternions; without them nothing is turned.
            about: The place of the node itself, world metres: the client draws what is seen
                through from the furthest node to the nearest.
        """
        self._handle.visible = len(positions) > 0
        if len(positions) == 0:
            return
        if wxyzs is None:
            wxyzs = np.broadcast_to(NO_TURN, (len(positions), 4))
        if about is not None:
            self._handle.position = about
            positions = positions - about
        self._handle.batched_positions = np.asarray(positions, dtype=np.float32)
        self._handle.batched_wxyzs = np.asarray(wxyzs, dtype=np.float32)
        self._handle.batched_scales = np.asarray(scales, dtype=np.float32)
        self._handle.batched_colors = linear(np.asarray(colour, dtype=np.uint8))
        if opacities is not None:
            self._handle.batched_opacities = np.asarray(opacities, dtype=np.float32)


class Targets:
    """Many copies of one mesh that nobody sees and that take clicks.

    They hide nothing either: viser's plain meshes write depth however faint they are, those of
    a glTF whose material blends do not.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        vertices: Float[ndarray, "V 3"],
        faces: ndarray,
        on_click: Callable[[int], None],
    ) -> None:
        """Make the node, hidden.

        Args:
            server: Where the node lives.
            name: Of the node.
            vertices: Of the mesh, its own units.
            faces: Triangles of indices.
            on_click: Called with the index of the copy that was clicked.
        """
        self._handle = server.scene.add_batched_glb(
            name,
            unseen(vertices, faces),
            batched_wxyzs=NO_TURN[None],
            batched_positions=np.zeros((1, 3)),
            batched_scales=np.ones((1, 3)),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._handle.on_click(passing(on_click))

    def show(self, positions: Float[ndarray, "N 3"], scales: Float[ndarray, "N 3"]) -> None:
        """Have these copies and no others; no rows hide the node."""
        self._handle.visible = len(positions) > 0
        if len(positions) == 0:
            return
        turns = np.broadcast_to(NO_TURN, (len(positions), 4))
        self._handle.batched_positions = np.asarray(positions, dtype=np.float32)
        self._handle.batched_wxyzs = np.asarray(turns, dtype=np.float32)
        self._handle.batched_scales = np.asarray(scales, dtype=np.float32)


def unseen(vertices: Float[ndarray, "V 3"], faces: ndarray) -> bytes:
    """A mesh as binary glTF, wholly transparent and from both sides the same."""
    import trimesh  # a third of a second, once the page is there

    looks: Any = trimesh.visual
    material = looks.material.PBRMaterial(
        baseColorFactor=[255, 255, 255, 0], alphaMode="BLEND", doubleSided=True
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.visual = looks.TextureVisuals(material=material)
    written = mesh.export(file_type="glb")
    assert isinstance(written, bytes)
    return written


def passing(on_click: Callable[[int], None]) -> Callable[[viser.SceneNodePointerEvent[Any]], None]:
    """What passes on which copy was clicked."""

    def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
        if event.instance_index is not None:
            on_click(event.instance_index)

    return clicked


_SCREEN = np.arange(256) / 255.0
_LINEAR = np.where(_SCREEN <= 0.04045, _SCREEN / 12.92, ((_SCREEN + 0.055) / 1.055) ** 2.4)
_TABLE = np.rint(255.0 * _LINEAR).astype(np.uint8)


def linear(colour: UInt8[ndarray, "*N 3"]) -> UInt8[ndarray, "*N 3"]:
    """Screen colours as viser's client wants those of single vertices and copies.

    It takes them as linear light and encodes them for the screen once more; colours
    of a whole node, and pictures, it takes as they are.
    """
    return np.asarray(_TABLE[colour], dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class Tag:
    """A label at a place, in metres."""

    position: tuple[float, float, float]
    text: str
    colour: colours.Rgb | None = None
    """Of what it names: a disc behind the words."""


def crowded(count: int) -> float:
    """How large labels are where there are so many, as a share: they are not to hide each other."""
    return round(max(SMALLEST, min(1.0, math.sqrt(ROOM_FOR / max(1, count)))), 1)


class Tags:
    """A pool of labels that face the viewer; it grows to the most that was needed.

    They are drawn above everything else, on a plate of the theme's ground. The disc behind one
    is a line without length, which viser's client draws as round as it is thick.
    """

    def __init__(self, server: viser.ViserServer, name: str, size: int, scale: float) -> None:
        """Make the pool, hidden.

        Args:
            server: Where the nodes live.
            name: Of the nodes, before their number.
            size: How many to make at once.
            scale: Of the letters; 1 is 12 pixels.
        """
        self._server = server
        self._name = name
        self._scale = self._drawn = scale
        self._discs = Lines(server, f"{name}_discs", DISC * scale)
        self._nodes: list[viser.LabelHandle] = []
        for _ in range(size):
            self._grow()

    def _grow(self) -> None:
        self._nodes.append(
            self._server.scene.add_label(
                f"{self._name}/{len(self._nodes):02d}",
                "",
                font_screen_scale=self._scale,
                anchor="center-center",
                visible=False,
            )
        )

    def show(self, tags: list[Tag]) -> None:
        """Show these labels and no others; smaller ones where there are many."""
        while len(self._nodes) < len(tags):
            self._grow()
        scale = self._scale * crowded(len(tags))
        if scale != self._drawn:
            self._drawn = scale
            self._discs.thickness = DISC * scale
        for node in self._nodes[: len(tags)]:
            if node.font_screen_scale != scale:
                node.font_screen_scale = scale
        for node, tag in zip(self._nodes, tags, strict=False):
            node.position = tag.position
            node.text = tag.text
            node.visible = True
        for node in self._nodes[len(tags) :]:
            node.visible = False
        marked = [tag for tag in tags if tag.colour is not None]
        places = np.array([tag.position for tag in marked]).reshape(-1, 3)
        ends = np.stack([places, places + np.array([0.0, 0.0, 1e-4])], axis=1)
        shades = np.array([tag.colour for tag in marked], dtype=np.uint8).reshape(-1, 1, 3)
        self._discs.show(ends, shades.repeat(2, axis=1))

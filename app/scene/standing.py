"""What stands still in the 3D scene: floor, volume, entrances, and the cameras with their pictures.

A frustum is drawn as an ideal pinhole with square pixels, looking along its axis.
So each picture is mapped through the lens model once more before it is shown:
straight lines of the room are straight in it, and who looks through the camera
sees the boxes of the 3D scene lie exactly over the people in the picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import viser
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from app import colours
from app.colours import Palette
from app.scene import geometry
from app.scene.nodes import Lines, Meshes, Tag, Tags
from app.scene.views import Pose
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Room

HALO = (0, 0, 0)


@dataclass(frozen=True, eq=False)
class StraightView:
    """A pinhole in a camera's place whose picture holds what the camera's holds."""

    camera: Camera
    """The real one."""
    width: int
    """The size of the straight picture, pixels."""

    @cached_property
    def rotation(self) -> Float[ndarray, "3 3"]:
        """From world to the straight camera's axes: its axis meets the middle of the picture.

        The real camera's axis meets the principal point, which may lie aside; by the
        shortest turn from one to the other the picture comes out the same on all sides.
        """
        width, height = self.camera.image_size
        middle = np.array([[(width - 1) / 2.0, (height - 1) / 2.0]])
        ahead = self.camera.rotation @ self.camera.back_project(middle)[0]
        x, y, z = ahead
        turn = np.eye(3) - np.array(
            [
                [x * x / (1.0 + z), x * y / (1.0 + z), x],
                [x * y / (1.0 + z), y * y / (1.0 + z), y],
                [-x, -y, 1.0 - z],
            ]
        )
        return np.asarray(turn @ self.camera.rotation)

    @cached_property
    def _half(self) -> tuple[float, float]:
        """Half width and half height of the picture plane at distance 1.

        From the middles of the edges: towards the corners, a barrel-shaped lens
        sees farther than that, so hardly anything empty comes into the picture.
        """
        width, height = self.camera.image_size
        x, y = (width - 1) / 2.0, (height - 1) / 2.0
        edges = np.array([[-0.5, y], [width - 0.5, y], [x, -0.5], [x, height - 0.5]])
        rays = self.camera.back_project(edges) @ self.rotation.T
        slopes = np.abs(rays[:, :2] / rays[:, 2:])
        return float(slopes[:2, 0].max()), float(slopes[2:, 1].max())

    @property
    def fov(self) -> float:
        """Vertical field of view, radians."""
        return 2.0 * float(np.arctan(self._half[1]))

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self._half[0] / self._half[1]

    @cached_property
    def pinhole(self) -> Camera:
        """The straight camera itself, for projecting into the straight picture."""
        height = max(2, round(self.width / self.aspect))
        focal = self.width / 2.0 / self._half[0]
        intrinsics = np.array(
            [
                [focal, 0.0, (self.width - 1) / 2.0],
                [0.0, height / 2.0 / self._half[1], (height - 1) / 2.0],
                [0.0, 0.0, 1.0],
            ]
        )
        return Camera(
            self.camera.name,
            (self.width, height),
            intrinsics,
            self.rotation,
            -self.rotation @ self.camera.centre,
            np.zeros(5),
        )

    @cached_property
    def _maps(self) -> tuple[ndarray, ndarray]:
        """Where each pixel comes from, in the fixed-point form that is fast to apply."""
        width, height = self.pinhole.image_size
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
        rays = self.pinhole.back_project(grid.astype(float))
        pixels, valid = self.camera.project(self.camera.centre + rays)
        pixels[~valid] = -10.0
        source = pixels.reshape(height, width, 2).astype(np.float32)
        first, second = cv2.convertMaps(source[..., 0], source[..., 1], cv2.CV_16SC2)
        return np.asarray(first), np.asarray(second)

    def picture(self, source: UInt8[ndarray, "h w 3"] | None) -> UInt8[ndarray, "H W 3"]:
        """The straight picture (BGR, always a new array); a plain plate where there is none."""
        width, height = self.pinhole.image_size
        if source is None:
            return np.full((height, width, 3), colours.PICTURE_EMPTY[::-1], dtype=np.uint8)
        first, second = self._maps
        border = colours.PALETTES["dark"].canvas[::-1]
        straight = cv2.remap(source, first, second, cv2.INTER_LINEAR, borderValue=border)
        return np.asarray(straight, dtype=np.uint8)

    def draw_boxes(
        self,
        picture: UInt8[ndarray, "H W 3"],
        positions: Float[ndarray, "N 3"],
        half_extents: Float[ndarray, " 3"],
        ids: Int[ndarray, " N"],
        selected: int | None,
    ) -> None:
        """Draw targets, reprojected, into a straight picture: far ones first, in their colours.

        Args:
            picture: Is changed in place.
            positions: World metres.
            half_extents: Half width, depth and height of a target.
            ids: One a position.
            selected: The id that is drawn stronger.
        """
        boxes, visible = self.pinhole.project_boxes(positions, half_extents)
        depths = self.pinhole.to_camera(np.asarray(positions, dtype=float).reshape(-1, 3))[:, 2]
        for index in np.argsort(-depths):
            if not visible[index]:
                continue
            left, top, width, height = boxes[index]
            corner = (round(left), round(top))
            opposite = (round(left + width), round(top + height))
            track = int(ids[index])
            colour = colours.track_colour(track)[::-1]
            thick = 3 if track == selected else 2
            cv2.rectangle(picture, corner, opposite, HALO, thick + 2, cv2.LINE_AA)
            cv2.rectangle(picture, corner, opposite, colour, thick, cv2.LINE_AA)
            _draw_tag(picture, corner, track, colour)

    def draw_note(self, picture: UInt8[ndarray, "H W 3"], text: str) -> None:
        """Write a short sentence into the middle of a picture."""
        height, width = picture.shape[:2]
        (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)
        place = ((width - wide) // 2, (height + tall) // 2)
        ink = (151, 151, 151)
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, ink, 1, cv2.LINE_AA)


def _draw_tag(
    picture: UInt8[ndarray, "H W 3"], corner: tuple[int, int], track: int, colour: tuple[int, ...]
) -> None:
    """The id on a small plate of its colour, above the box's left edge."""
    text = str(track)
    (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.42, 1)
    x, y = max(0, corner[0] - 1), max(tall + 6, corner[1])
    cv2.rectangle(picture, (x, y - tall - 6), (x + wide + 5, y), colour, cv2.FILLED)
    ink = (255, 255, 255) if colours.track_ink(track) == "#fff" else (0, 0, 0)
    place = (x + 3, y - 3)
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, ink, 1, cv2.LINE_AA)


GRID_MARGIN = 1.0
"""Metres that the floor reaches beyond the volume."""
RIM_POINTS = 48
LARGEST_FRUSTUM = 1.6
"""Metres that a frustum reaches, however large the room."""
WIDEST_PICTURE = 0.125
"""Width of a frustum's picture, of the room's diagonal: one in front of the room hides people."""
FRUSTUM_WIDTH = 320
"""Pixels of the picture on a frustum."""
BACKDROP_WIDTH = 960
"""Pixels of the picture of the camera that somebody looks through."""
FRUSTA = 4
"""Made at once; a sequence with more cameras adds some for good."""


class RoomNodes:
    """Floor, volume and entrances."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Make the nodes, hidden."""
        self._minor = Lines(server, "/room/grid", 1.0)
        self._major = Lines(server, "/room/grid_major", 1.0)
        self._volume = Lines(server, "/room/volume", 1.0)
        sphere = geometry.icosphere(2)
        self._entrances = Meshes(server, "/room/entrances", *sphere, opacity=0.05)
        self._rims = Lines(server, "/room/entrance_rims", 1.0)
        self._names = Tags(server, "/labels/entrances", 4, 0.55)
        self._height = Tags(server, "/labels/height", 1, 0.6)
        cube = geometry.unit_cube()
        self._ground = Meshes(server, "/room/ground", *cube, opacity=1.0)
        # seen from inside alone: the walls behind are faint faces, those in front are their lines
        self._walls = server.scene.add_mesh_simple(
            "/room/walls",
            *cube,
            side="back",
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def show(self, room: Room, palette: Palette, *, volume: bool, floor: bool) -> None:
        """Draw a room.

        Args:
            room: Its volume and entrances.
            palette: The colours of the theme.
            volume: Whether that layer is on.
            floor: Whether the grid is drawn, with the entrances on it.
        """
        low, high = room.minimum, room.maximum
        height = float(low[2])
        cell = geometry.grid_cell(room)
        margin = max(GRID_MARGIN, 0.5 * float((high - low)[:2].min()))
        for node, lines, shade in zip(
            (self._minor, self._major),
            geometry.floor_grid(low[:2] - margin, high[:2] + margin, height, cell),
            (palette.grid_minor, palette.grid_major),
            strict=True,
        ):
            pieces = geometry.pieces(lines[: None if floor else 0], cell)
            beside = geometry.distance_beside(pieces[..., :2], low[:2], high[:2])
            fading = np.broadcast_to(np.array(shade, dtype=np.uint8), pieces.shape)
            node.show(pieces, palette.fade(fading, 1.0 - beside / margin))
        middle, size = (low + high)[None] / 2.0, (high - low) / 2.0
        inside = np.array([middle[0, 0], middle[0, 1], height - 0.003])[None]
        flat = np.array([size[0], size[1], 1e-3])[None]
        tint = np.array([palette.ground], dtype=np.uint8)
        shown = slice(None if floor and volume else 0)
        self._ground.show(inside[shown], flat[shown], tint[shown])
        self._walls.visible = volume and floor
        if self._walls.visible:
            self._walls.position, self._walls.scale = tuple(middle[0]), tuple(size)
            self._walls.color, self._walls.opacity = palette.line, 0.05
        top = (float(high[0]), float(low[1]), float(high[2]))
        # one label: a scale up the edge would lie over who stands before it
        self._height.show([Tag(top, f"{high[2] - height:g} m")] if volume and floor else [])
        edges = geometry.box_edges((low + high)[None] / 2.0, (high - low) / 2.0)[0]
        self._volume.show(edges if volume else edges[:0], palette.volume)
        entrances = room.entrances if volume and floor else ()
        places = np.array([e.position for e in entrances]).reshape(-1, 3)
        sigmas = np.array([e.sigma for e in entrances]).reshape(-1, 3)
        places[:, 2] = height + 0.004  # on the floor, in front of its lines
        radius = geometry.mass_radius(geometry.DEFAULT_MASS, 2)
        axes = np.concatenate([sigmas[:, :2] * radius, np.full((len(sigmas), 1), 1e-3)], axis=1)
        grey = np.broadcast_to(np.array(palette.line, dtype=np.uint8), places.shape)
        self._entrances.show(places, axes, grey)
        self._rims.show(_rims(places, axes), palette.entrance)
        self._names.show([Tag(tuple(place.tolist()), "entrance") for place in places])


def entrance_edges(room: Room) -> Float[ndarray, "N 3"]:
    """How far the discs of the entrances reach on the floor: four points each, metres."""
    radius = geometry.mass_radius(geometry.DEFAULT_MASS, 2)
    points = [np.zeros((0, 3))]
    for entrance in room.entrances:
        middle = np.array([*entrance.position[:2], room.minimum[2]])
        reach = np.diag([*entrance.sigma[:2] * radius, 0.0])[:2]
        points += [middle + reach, middle - reach]
    return np.concatenate(points)


def _rims(centres: Float[ndarray, "N 3"], axes: Float[ndarray, "N 3"]) -> Float[ndarray, "S 2 3"]:
    """The outlines of flat ellipses."""
    angles = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS + 1)
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    points = centres[:, None] + circle * axes[:, None]
    return np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)


class FrustumNodes:
    """The cameras with their pictures."""

    def __init__(self, server: viser.ViserServer, on_click: Callable[[int], None]) -> None:
        """Make the nodes, hidden.

        Args:
            server: Where they live.
            on_click: Called with the index of the camera that was clicked.
        """
        self._server = server
        self._on_click = on_click
        self._handles: list[viser.CameraFrustumHandle] = []
        self._names = Tags(server, "/labels/cameras", FRUSTA, 0.85)
        self._cameras: tuple[Camera, ...] = ()
        self._sizes: list[float] = []
        self._views: dict[tuple[int, int], StraightView] = {}
        self._through: int | None = None
        for _ in range(FRUSTA):
            self._grow()

    def _grow(self) -> None:
        index = len(self._handles)
        handle = self._server.scene.add_camera_frustum(
            f"/cameras/{index:02d}",
            fov=1.0,
            aspect=1.0,
            thickness=1.0,
            thickness_units="screen",
            color=colours.PALETTES["dark"].line,
            jpeg_quality=80,
            format="jpeg",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

        @handle.on_click
        def _(_: viser.SceneNodePointerEvent[viser.CameraFrustumHandle]) -> None:
            self._on_click(index)

        self._handles.append(handle)

    def place(
        self, cameras: tuple[Camera, ...], room: Room, through: int | None, palette: Palette
    ) -> None:
        """Put the frusta where the cameras are.

        Args:
            cameras: Those of the sequence.
            room: Gives the measure of how large to draw them.
            through: The one that is looked through: its picture stands behind the room.
            palette: The colours of the theme.
        """
        if cameras != self._cameras:
            self._cameras, self._views = cameras, {}
        while len(self._handles) < len(cameras):
            self._grow()
        corners = geometry.box_corners(room.minimum, room.maximum)
        across = float(np.linalg.norm(room.maximum - room.minimum))
        self._sizes = [self._size_of(index, across) for index in range(len(cameras))]
        self._through = through
        tags: list[Tag] = []
        for index, camera in enumerate(cameras):
            handle, view = self._handles[index], self.view(index)
            depth = self._sizes[index]
            if index == through:
                depth = 1.2 * float(camera.to_camera(corners)[:, 2].max())
            else:
                above = camera.centre + np.array([0.0, 0.0, 0.3 * depth])
                tags.append(Tag((above[0], above[1], above[2]), camera.name))
            handle.fov, handle.aspect = view.fov, view.aspect
            handle.color = palette.line
            handle.scale = depth / handle.compute_canonical_frustum_size()[2]
            handle.position = camera.centre
            handle.wxyz = geometry.quaternions(view.rotation.T[None])[0]
            handle.visible = True
        for handle in self._handles[len(cameras) :]:
            handle.visible = False
        self._names.show(tags)

    def _size_of(self, index: int, across: float) -> float:
        """Metres that a frustum reaches in a room so large across: its picture hides little."""
        view = self.view(index)
        width = 2.0 * float(np.tan(view.fov / 2.0)) * view.aspect
        return min(0.115 * across, WIDEST_PICTURE * across / width, LARGEST_FRUSTUM)

    def corners(self, chosen: ndarray) -> Float[ndarray, "N 3"]:
        """What the chosen frusta take of the scene: eyes, corners of the pictures, names."""
        points = [np.zeros((0, 3))]
        for index in np.flatnonzero(chosen):
            camera, view, size = self._cameras[index], self.view(int(index)), self._sizes[index]
            half = size * np.tan(view.fov / 2.0)
            rim = [(x * half * view.aspect, y * half, size) for x in (-1, 1) for y in (-1, 1)]
            points += [camera.centre + np.array(rim) @ view.rotation, camera.centre[None]]
            points.append(camera.centre[None] + np.array([0.0, 0.0, 0.6 * size]))
        return np.concatenate(points)

    def pictures(self, chosen: ndarray) -> tuple[Float[ndarray, "C 3"], Float[ndarray, "C 3"]]:
        """Middles of the pictures of the chosen frusta, and the directions that these face."""
        indices = np.flatnonzero(chosen).tolist()
        ahead = np.array([self.view(index).rotation[2] for index in indices]).reshape(-1, 3)
        eyes = np.array([self._cameras[index].centre for index in indices]).reshape(-1, 3)
        sizes = np.array([self._sizes[index] for index in indices]).reshape(-1, 1)
        return eyes + sizes * ahead, ahead

    def view(self, index: int) -> StraightView:
        """The straight picture of a camera, as large as it is to be drawn now."""
        width = BACKDROP_WIDTH if index == self._through else FRUSTUM_WIDTH
        if (index, width) not in self._views:
            self._views[index, width] = StraightView(self._cameras[index], width)
        return self._views[index, width]

    def show_picture(self, index: int, picture: ndarray) -> None:
        """Put a straight picture (BGR) onto a frustum."""
        self._handles[index].image = picture[:, :, ::-1]


def pose_through(view: StraightView, distance: float, aspect: float) -> Pose:
    """Where to look from to see just what a camera sees.

    Args:
        view: The camera's straight view.
        distance: Metres ahead that the viewpoint turns around.
        aspect: Width over height of the window; the whole picture fits into it.
    """
    camera = view.camera
    slope = np.tan(view.fov / 2.0) * max(1.0, view.aspect / aspect) * 1.03
    return Pose(
        position=camera.centre,
        look_at=camera.centre + distance * view.rotation[2],
        up=-view.rotation[1],
        fov=2.0 * float(np.arctan(slope)),
    )

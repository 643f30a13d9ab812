"""The cameras' pictures as the frusta of the 3D scene carry them: small, straight, with boxes.

A frustum is drawn as an ideal pinhole with square pixels, looking along its axis.
So each picture is mapped through the lens model once more before it is shown:
straight lines of the room are straight in it, and who looks through the camera
sees the boxes of the 3D scene lie exactly over the people in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from app import colours
from tracker.geometry.camera import Camera

HALO = (0, 0, 0)


@dataclass(frozen=True, eq=False)
class StraightView:
    """A pinhole in a camera's place whose picture holds what the camera's holds."""

    camera: Camera
    """The real one."""
    width: int
    """Of the straight picture, pixels."""

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

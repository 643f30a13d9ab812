"""What the cameras of a random room do to its light: exposure, colour, flicker, shake, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d

from tests.rooms.random_rooms.choices import Choices, generator
from tests.rooms.walls.background import Background
from tracker.geometry.camera import Camera

_MIDDLE_GREY = 0.105
"""Mean light of the empty room that a camera exposes for."""
_SHAKE = {"none": 0.0, "slight": 0.8, "strong": 2.6}
"""Standard deviation in pixels of a picture of 480 lines."""
_SHAKE_LASTS = 0.25
"""Seconds after which a shaken camera has forgotten where it was."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFilm:
    """One camera's ways over all steps."""

    gains: Float[ndarray, "F h 3"]
    """Factors on the light by step, row and colour (red, green, blue)."""
    moved: Float[ndarray, "F 3"]
    """How the picture is shifted right and down, pixels, and turned, radians."""
    grain: float
    """Strength of the noise, 1 for a plain camera in good light."""
    quality: int
    """Of the pictures' compression, 1 to 100."""

    def finished(self, step: int, picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w 3"]:
        """A drawn picture as the shaken camera takes it."""
        right, down, turn = self.moved[step]
        if not self.moved[step].any():
            return picture
        height, width = picture.shape[:2]
        middle = ((width - 1) / 2.0, (height - 1) / 2.0)
        matrix = cv2.getRotationMatrix2D(middle, float(np.degrees(turn)), 1.0)
        matrix[:, 2] += right, down
        return np.asarray(
            cv2.warpAffine(picture, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
        )


def record(
    choices: Choices, cameras: Sequence[Camera], backgrounds: Sequence[Background]
) -> list[CameraFilm]:
    """What each camera does.

    Args:
        choices: Of the room.
        cameras: As their pictures are drawn.
        backgrounds: The empty room before each, which it is exposed for.
    """
    rng = generator(choices.seed, 6)
    times = np.arange(choices.steps) / choices.fps
    room_light = _room_light(choices, times, rng)
    films = []
    for camera, background in zip(cameras, backgrounds, strict=True):
        films.append(_film(choices, camera, background, room_light, times, rng))
    return films


def _room_light(choices: Choices, times: ndarray, rng: np.random.Generator) -> ndarray:
    """Factors (F, 3) on all of the room's light."""
    steps, duration = choices.steps, choices.duration
    colour = np.ones((steps, 3))
    match choices.light:
        case "drifting":
            end = float(rng.uniform(0.45, 0.75))
            end = end if rng.random() < 0.5 else 1.0 / end
            share = times / duration
            colour *= (end**share)[:, None]
            colour *= 1.0 + 0.1 * share[:, None] * rng.uniform(-1.0, 1.0, 3)
        case "switched":
            factor = float(rng.choice([0.5, 0.6, 1.5, 1.8]))
            tint = 1.0 + 0.12 * rng.uniform(-1.0, 1.0, 3)
            on = rng.uniform(0.25, 0.75) * duration
            colour[times >= on] *= factor * tint
            if rng.random() < 0.5:
                colour[times >= on + rng.uniform(0.1, 0.25) * duration] /= factor * tint
        case "clouds":
            slow = _wavering(rng.standard_normal(steps + 1), 0.9 * choices.fps)
            colour *= np.exp(0.22 * slow)[:, None]
        case _:
            pass
    return colour


def _wavering(noise: Float[ndarray, " F1 *k"], steps: float) -> Float[ndarray, " F *k"]:
    """What comes and goes within about so many steps, about 0, with standard deviation 1.

    In a recording that is shorter than that the mean would be many of its deviations away from 0.
    """
    slow = gaussian_filter1d(noise, steps, axis=0, mode="wrap")[:-1]
    return np.asarray((slow - slow.mean(axis=0)) / (slow.std(axis=0) + 1e-9))


def _film(
    choices: Choices, camera: Camera, background: Background, room_light: ndarray, times: ndarray,
    rng: np.random.Generator,
) -> CameraFilm:  # fmt: skip
    steps, height = choices.steps, camera.image_size[1]
    exposure = np.clip(_MIDDLE_GREY / float(background.room.mean()), 0.25, 4.0)
    exposure *= np.exp(rng.normal(0.0, 0.12))
    balance = np.ones(3)
    # the eye of the camera takes the room's mean for grey, by half
    mean = background.room.mean(axis=(0, 1))
    balance *= (mean.mean() / mean) ** 0.5
    if choices.white_balance == "unlike":
        balance *= np.exp(rng.normal(0.0, 0.13, 3))
    gains = exposure * balance * room_light
    slow = rng.standard_normal((steps + 1, 3))
    if choices.white_balance == "wandering":
        gains = gains * np.exp(0.07 * _wavering(slow, 1.2 * choices.fps))
    if choices.exposure == "hunting":
        # it follows the room's light late, and is drawn about by who stands before it
        level = np.log(room_light.mean(axis=1))
        late = gaussian_filter1d(np.pad(level, (steps, 0), mode="edge"), 0.5 * choices.fps)[steps:]
        hunt = _wavering(rng.standard_normal(steps + 1), 0.8 * choices.fps)
        gains = gains * np.exp(0.11 * hunt - 0.8 * late)[:, None]
    rows = np.ones((steps, height))
    if choices.light == "flickering":
        # lamps at twice the mains' frequency against a shutter that reads row by row
        beat, bands = rng.uniform(0.2, 0.5) * choices.fps, rng.uniform(0.7, 2.5)
        phase = 2.0 * np.pi * (beat * times[:, None] + bands * np.arange(height) / height)
        rows += rng.uniform(0.05, 0.14) * np.sin(phase + rng.uniform(0.0, 6.3))
    strength = _SHAKE[choices.shake] * min(camera.image_size) / 480.0
    lasting = np.exp(-1.0 / (_SHAKE_LASTS * choices.fps))
    moved = np.zeros((steps, 3))
    if strength > 0.0:
        place = np.zeros(3)
        for step, push in enumerate(rng.standard_normal((steps, 3))):
            place = lasting * place + np.sqrt(1.0 - lasting**2) * push
            moved[step] = place * [strength, strength, 0.5 * strength / min(camera.image_size)]
    grain = rng.uniform(2.4, 4.5) if choices.noise == "strong" else rng.uniform(0.6, 1.4)
    quality = rng.integers(9, 26) if choices.compression == "strong" else rng.integers(72, 93)
    lines = (gains[:, None, :] * rows[:, :, None]).astype(np.float32)
    return CameraFilm(lines, moved, float(grain), int(quality))

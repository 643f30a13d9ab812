"""What a random room is made of: drawn once from its seed, and written beside it as labels."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeVar

import numpy as np

Lens = Literal["pinhole", "mild", "barrel", "fisheye"]
Turned = Literal["upright", "quarter", "upside down", "slanted"]
Mounting = Literal["low", "middle", "high"]
Light = Literal["steady", "drifting", "switched", "clouds", "flickering"]
Exposure = Literal["fixed", "hunting"]
WhiteBalance = Literal["alike", "unlike", "wandering"]
Shadows = Literal["soft", "hard"]
Shake = Literal["none", "slight", "strong"]
Noise = Literal["weak", "strong"]
Compression = Literal["weak", "strong"]
Clothes = Literal["unlike", "alike", "of the wall"]
Walls = Literal["pale", "vivid", "skin", "clothing"]
Target = Literal["whole body", "head and torso"]
Behaviour = Literal["walks", "stands", "sits", "rises", "lies", "comes and goes"]

Option = TypeVar("Option")

_SIZES = {(320, 240): 0.24, (360, 288): 0.22, (640, 360): 0.22, (640, 480): 0.20,
          (1280, 720): 0.08, (1920, 1080): 0.04}  # fmt: skip
_COSTLY = 2.6e8
"""Pixels in all pictures of a room, from which it is made shorter."""
_STEPS = (60, 180)


@dataclass(frozen=True, slots=True)
class Choices:
    """Everything about a room that a method may stumble over."""

    seed: int
    cameras: int
    fps: float
    steps: int
    image_size: tuple[int, int]
    """Width and height in pixels, before a quarter turn of who mounted it."""
    lens: Lens
    turned: Turned
    mounting: Mounting
    width: float
    """Metres between the walls, along x."""
    depth: float
    """Along y."""
    ceiling: float
    target: Target
    behaviours: tuple[Behaviour, ...]
    """Of each person."""
    clothes: Clothes
    walls: Walls
    light: Light
    exposure: Exposure
    white_balance: WhiteBalance
    shadows: Shadows
    shake: Shake
    noise: Noise
    compression: Compression
    mirror: bool
    screen: bool
    """Whether a screen shows moving pictures."""
    plant: bool
    """Whether a plant moves in a draught."""
    table: bool
    """Whether a table stands in the middle, with chairs."""
    templates: int
    """Boxes marked of each person, at most."""
    entrances: bool
    """Whether the sequence says where the doors are."""

    @property
    def people(self) -> int:
        """How many there are in all."""
        return len(self.behaviours)

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.steps / self.fps

    def to_json(self) -> dict[str, Any]:
        """All of it, as it is written."""
        return asdict(self) | {"people": self.people}

    def causes(self) -> dict[str, str]:
        """What tells this room from an easy one, by name, in words that many rooms share."""
        height = min(self.image_size)
        stays = all(b != "comes and goes" for b in self.behaviours)
        still = sum(b in ("sits", "stands", "lies") for b in self.behaviours)
        yes = {True: "yes", False: "no"}
        return {
            "cameras": "2" if self.cameras == 2 else "3–4" if self.cameras <= 4 else "5–8",
            "rate": "≤ 10/s" if self.fps <= 10 else "≤ 30/s" if self.fps <= 30 else "60/s",
            "lines": "≤ 288" if height <= 288 else "≤ 480" if height <= 480 else "> 480",
            "lens": self.lens,
            "turned": self.turned,
            "mounting": self.mounting,
            "target": self.target,
            "boxes marked": f"{self.templates} a person",
            "people": "1" if self.people == 1 else "2–3" if self.people <= 3 else "4–8",
            "all stay": yes[stays],
            "still people": "none" if not still else "all" if still == self.people else "some",
            "someone lies": yes["lies" in self.behaviours],
            "someone sits": yes["sits" in self.behaviours or "rises" in self.behaviours],
            "clothes": self.clothes,
            "walls": self.walls,
            "light": self.light,
            "exposure": self.exposure,
            "white balance": self.white_balance,
            "shadows": self.shadows,
            "shake": self.shake,
            "noise": self.noise,
            "compression": self.compression,
            "mirror": yes[self.mirror],
            "screen": yes[self.screen],
            "plant": yes[self.plant],
            "table": yes[self.table],
        }


def generator(seed: int, part: int) -> np.random.Generator:
    """The randomness of one part of a room: what one part draws changes no other."""
    return np.random.default_rng([20, seed, part])


def choose(seed: int) -> Choices:
    """The choices of the room with this seed.

    Most rooms have a few difficulties and not all at once: each is left out more often
    than not.

    Raises:
        ValueError: If the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"the seed of a random room must be 0 or more, got {seed}")
    rng = generator(seed, 0)

    def pick(options: dict[Option, float]) -> Option:
        shares = np.array(list(options.values()))
        return list(options)[int(rng.choice(len(options), p=shares / shares.sum()))]

    cameras = pick({2: 0.2, 3: 0.22, 4: 0.3, 5: 0.1, 6: 0.08, 7: 0.05, 8: 0.05})
    size = pick(_SIZES)
    fps = pick({5.0: 0.1, 10.0: 0.15, 15.0: 0.15, 25.0: 0.25, 30.0: 0.25, 60.0: 0.1})
    width, depth = float(rng.uniform(3.4, 8.0)), float(rng.uniform(3.2, 6.8))
    room_for = max(1, int(width * depth / 2.6))
    people = min(room_for, pick({1: 0.15, 2: 0.25, 3: 0.2, 4: 0.14, 5: 0.1, 6: 0.07, 7: 0.05,
                                 8: 0.04}))  # fmt: skip
    stay = rng.random() < 0.45
    alone: dict[Behaviour, float] = {
        "walks": 0.38, "stands": 0.21, "sits": 0.25, "rises": 0.12, "lies": 0.04
    }  # fmt: skip
    behaviours: tuple[Behaviour, ...] = tuple(
        pick(alone) if stay or rng.random() < 0.3 else "comes and goes" for _ in range(people)
    )
    drawn = cameras * min(size[0] * size[1], 960 * 540)  # larger pictures are drawn at half size
    steps = int(np.clip(6.0 * fps, 120, _STEPS[1]))
    steps = int(np.clip(_COSTLY / drawn, _STEPS[0], steps))
    lies = "lies" in behaviours
    return Choices(
        seed=seed,
        cameras=cameras,
        fps=fps,
        steps=steps,
        image_size=size,
        lens=pick({"pinhole": 0.3, "mild": 0.4, "barrel": 0.18, "fisheye": 0.12}),
        turned=pick({"upright": 0.68, "quarter": 0.16, "upside down": 0.04, "slanted": 0.12}),
        mounting=pick({"low": 0.25, "middle": 0.35, "high": 0.4}),
        width=round(width, 2),
        depth=round(depth, 2),
        ceiling=round(float(rng.uniform(2.5, 3.3)), 2),
        target="head and torso" if lies else pick({"whole body": 0.5, "head and torso": 0.5}),
        behaviours=behaviours,
        clothes=pick({"unlike": 0.7, "alike": 0.18, "of the wall": 0.12}),
        walls=pick({"pale": 0.6, "vivid": 0.16, "skin": 0.12, "clothing": 0.12}),
        light=pick({"steady": 0.55, "drifting": 0.13, "switched": 0.1, "clouds": 0.1,
                    "flickering": 0.12}),
        exposure=pick({"fixed": 0.75, "hunting": 0.25}),
        white_balance=pick({"alike": 0.5, "unlike": 0.38, "wandering": 0.12}),
        shadows=pick({"soft": 0.7, "hard": 0.3}),
        shake=pick({"none": 0.8, "slight": 0.13, "strong": 0.07}),
        noise=pick({"weak": 0.75, "strong": 0.25}),
        compression=pick({"weak": 0.72, "strong": 0.28}),
        mirror=bool(rng.random() < 0.15),
        screen=bool(rng.random() < 0.22),
        plant=bool(rng.random() < 0.22),
        table=bool(rng.random() < 0.3 and width > 4.2 and depth > 3.8),
        templates=pick({1: 0.6, 2: 0.25, 4: 0.15}),
        entrances=bool(rng.random() < 0.7),
    )  # fmt: skip

"""What the people of a random room look like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.rooms.random_rooms.choices import Choices, generator
from tests.rooms.walls.textures import Look

_SHIRTS = (
    "#a83a24", "#2450a8", "#3f8f3a", "#d9a821", "#6a3a8c", "#14786f", "#c24a78", "#e6e3da",
    "#23262b", "#7d8087", "#8fb3d9", "#c96f2c", "#5a2a2e", "#2f4a35", "#b9a98a", "#3a4a6b",
)  # fmt: skip
_TROUSERS = ("#26324a", "#8a7857", "#2b2b30", "#3b4048", "#42372e", "#5d6b7d", "#a59a83", "#1d1e22")
_ACCENTS = ("#d8d2c4", "#dfe5ee", "#e0d8a0", "#2a2c33", "#d9cbe6", "#b84a3a", "#d8e8e2")
_SKINS = ("#d3a184", "#dcb096", "#e0b79e", "#a8734f", "#c99674", "#7a4e34", "#5b3a28")
_HAIRS = ("#2a1c14", "#5c4026", "#4a2c1a", "#1d1714", "#8a6a42", "#3a2416", "#9a958c", "#b98f55")
_SHOES = ("#1c1a19", "#5a3a26", "#e8e4da", "#5b5b5f", "#3a2a1e")
_PATTERNS = ("plain", "plain", "plain", "stripes", "checks", "zip", "band")


def dress(choices: Choices) -> list[Look]:
    """Clothes for everybody: all unlike, or those of one kind, as for a team."""
    rng = generator(choices.seed, 3)

    def one(colours: tuple[str, ...]) -> str:
        return str(rng.choice(colours))

    shirts = rng.permutation(len(_SHIRTS))
    looks = [
        Look(
            stature=round(float(np.clip(rng.normal(1.72, 0.09), 1.48, 1.96)), 2),
            shirt=_SHIRTS[shirts[number % len(_SHIRTS)]],
            pattern=one(_PATTERNS),
            accent=one(_ACCENTS),
            trousers=one(_TROUSERS),
            shoes=one(_SHOES),
            hair=one(_HAIRS),
            skin=one(_SKINS),
            long_hair=bool(rng.random() < 0.4),
            short_sleeves=bool(rng.random() < 0.35),
            build=round(float(rng.uniform(0.94, 1.2)), 2),
        )
        for number in range(choices.people)
    ]
    if choices.clothes == "alike":
        first = looks[0]
        looks = [
            replace(look, shirt=first.shirt, pattern=first.pattern, accent=first.accent,
                    trousers=first.trousers)
            for look in looks
        ]  # fmt: skip
    return looks

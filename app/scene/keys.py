"""The keys of the 3D view: those of the page's one list of commands that viser can take.

Inside the page its keys are heard in the frame itself; these are for a 3D view that
somebody has opened in a window of its own, from where they reach every page.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

from viser._messages import HotkeyKey, KeyModifier

from app.paths import static_folder

VISERS_OWN = frozenset({*"WASDQE", "arrowup", "arrowdown", "arrowleft", "arrowright"})
"""Keys with which viser itself moves the viewpoint."""

_MODIFIERS: dict[str, KeyModifier | None] = {"": None, "Shift": "shift", "Ctrl": "cmd/ctrl"}
_KNOWN: dict[str, HotkeyKey] = {key.lower(): key for key in get_args(HotkeyKey)}


@dataclass(frozen=True, slots=True)
class Hotkey:
    """A command of the page and the key that it has inside the 3D view."""

    name: str
    title: str
    key: HotkeyKey
    modifier: KeyModifier | None


def hotkeys() -> Iterator[Hotkey]:
    """The commands of ``static/commands.json`` with a key that viser knows and does not use.

    Of a key that means something else at another place of the page the first meaning counts.
    """
    taken: set[tuple[HotkeyKey, KeyModifier | None]] = set()
    text = (static_folder() / "commands.json").read_text(encoding="utf-8")
    for commands in json.loads(text).values():
        for command in commands:
            for written in command["keys"]:
                modifier, _, letter = written.rpartition("+")
                key = _KNOWN.get(letter.lower())
                if key is None or modifier not in _MODIFIERS:
                    continue
                chord = (key, _MODIFIERS[modifier])
                if (key in VISERS_OWN and modifier == "") or chord in taken:
                    continue
                taken.add(chord)
                yield Hotkey(command["name"], command["title"], *chord)
                break

"""Remedies of checks as flags of the import that is being checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracker.io.checks import Check, Remedy
from tracker.io.conventions.level import upwards
from tracker.io.conventions.reading import UPS, Reading, upright
from tracker.io.read.pieces import METRES, Unit, Up
from tracker.sequences.finding import warning

_LEAST_HEAD = 0.21
"""Metres: the box of a head is as high; what is smaller is nobody's."""

_LEAST_HEIGHT, _MOST_HEIGHT = 1.0, 2.2
"""Metres: boxes of people who sit or stand."""

_OTHER = {
    "opencv": "opengl",
    "opengl": "opencv",
}


def unsaid(notes: Sequence[str], checks: Sequence[Check]) -> list[str]:
    """The notes of an import that no check of what it wrote says as well."""
    return [note for note in notes if not any(note in one.sentence for one in checks)]


def for_import(check: Check, reading: Reading) -> Check:
    """A check of an imported sequence, its remedies as flags that import the same files rightly.

    A check judges the sequence: to it a calibration that was read with inverted poses, and
    should not have been, is one with inverted poses.

    Args:
        check: Of the sequence.
        reading: As the files were read to make it.
    """
    found = [_for_import(remedy, reading) for remedy in check.remedies]
    told = replace(check, remedies=tuple(remedy for remedy in found if remedy is not None))
    height = check.numbers.get("height", 0.0)
    small = check.name == "size of people" and 0.0 < height < _LEAST_HEAD
    return _larger(told, height, reading.unit) if small and not told.remedies else told


def _larger(check: Check, height: float, unit: Unit) -> Check:
    """People smaller than a head, and the unit of the file in which they are people.

    What is tracked has the size that the boxes show, so that the check itself finds both alike.
    """
    for name, metres in METRES.items():
        tall = height * metres / METRES[unit]
        if _LEAST_HEIGHT < tall < _MOST_HEIGHT:
            sentence = (
                f"boxes are {height:.2g} m tall in the room; with the file's numbers in {name} "
                f"they are {tall:.2f} m, as people are"
            )
            return warning(check.name, sentence, Remedy("--unit", name), height=height)
    return check


def _for_import(remedy: Remedy, reading: Reading) -> Remedy | None:
    match remedy.flag:
        case "--pose":
            if reading.direction == "world-to-camera":
                return remedy
            # each way undoes itself; one after the other is no usual way
            undone = remedy.value == reading.direction
            return replace(remedy, value="world-to-camera") if undone else None
        case "--axes":
            return replace(remedy, value=_OTHER[reading.axes])
        case "--unit":
            return _unit(remedy, reading.unit)
        case "--up":
            return replace(remedy, value=_up(remedy.value, reading.up))
    return remedy


def _unit(remedy: Remedy, unit: Unit) -> Remedy | None:
    """One unit of the file in metres, where it is one that has a name."""
    wanted = METRES[unit] * next(m for name, m in METRES.items() if name == remedy.value)
    names = [name for name, metres in METRES.items() if np.isclose(metres, wanted)]
    return replace(remedy, value=names[0] if names else f"{wanted:g}")


def _up(wanted: str, up: Up) -> Up:
    """The axis of the file that is this axis of the sequence's world."""
    axis = upright(next(name for name in UPS if name == wanted)).T @ np.array([0.0, 0.0, 1.0])
    return upwards(upright(up).T @ axis)

"""``python -m tests.checks``: what is named and what is found, on recordings and random rooms.

Two tables: the usual mistakes, each made in every recording that has boxes, with the remedies
that are named; and cameras made late on purpose, with the offsets that are found.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tests.conftest import DATA
from tests.mistakes import MISTAKES
from tests.random_rooms import random_room
from tracker.checks import check
from tracker.checks.synchronisation import synchronise
from tracker.sequences.library import open_sequence
from tracker.sequences.sequence import Sequence

WITH_BOXES = ("cmc1", "cmc2", "wildtrack-points-300", "av163-seq45-3p-1111-points")
WITH_PICTURES = ("av163-seq30-2p-1101",)
ROOMS = ("room24-2p", "room35-2p", "room44-3p")
LATE = (-25, -10, 7, 20, 40)


def say(text: str) -> None:
    """One line."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def recordings() -> Iterator[Sequence]:
    """All that is correct."""
    for name in (*WITH_BOXES, *WITH_PICTURES):
        if (DATA / name).is_dir():
            yield open_sequence(DATA / name)
    for name in ROOMS:
        yield open_sequence(name)
    for seed in range(6):
        yield random_room(seed)


def mistakes() -> None:
    """Remedies named, of the usual mistakes made in each recording."""
    right = total = 0
    for sequence in recordings():
        alarms = [str(found) for found in check(sequence) if found.status == "warning"]
        say(f"{sequence.name}: {len(alarms)} false alarms {alarms or ''}")
        if not sequence.has_detections:
            continue
        for name, (make, remedy) in MISTAKES.items():
            found = [each for each in check(make(sequence)) if each.status == "warning"]
            named = [str(own) for each in found for own in each.remedies]
            right, total = right + (named == [remedy]), total + 1
            say(f"  {name}: {'right' if named == [remedy] else 'WRONG'}: {named}")
    say(f"{right} of {total} mistakes named with the right remedy alone")


def late_pictures(sequence: Sequence, steps: int) -> Sequence:
    """The second camera's pictures late by so many steps; both ends are cut off for it."""
    margin = abs(steps)
    views = [
        replace(view, first_frame=view.first_frame + margin - (steps if camera == 1 else 0))
        for camera, view in enumerate(sequence.views)
    ]
    return replace(sequence, views=tuple(views), frames=sequence.frames - 2 * margin)


def half_a_frame(sequence: Sequence) -> Sequence:
    """Every other picture, of the second camera those in between: early by half a step."""
    frames = sequence.frames // 2
    views = []
    for camera, view in enumerate(sequence.views):
        shown = 2 * np.arange(frames) + view.first_frame + (camera == 1)
        clock = _Clock(shown)
        views.append(replace(view, clock=clock))
    return replace(sequence, views=tuple(views), frames=frames, fps=sequence.fps / 2.0)


class _Clock:
    """Just which frame each step shows."""

    def __init__(self, frame_of_step: np.ndarray) -> None:
        self.frame_of_step = frame_of_step


def offsets() -> None:
    """Offsets found from pictures, of cameras made late."""
    good = total = 0
    names = [name for name in WITH_PICTURES if (DATA / name).is_dir()]
    for sequence in [open_sequence(name) for name in ROOMS] + [
        open_sequence(DATA / name) for name in names
    ]:
        cases = [(steps, late_pictures(sequence, steps)) for steps in LATE]
        for late, shifted in [*cases, (-0.5, half_a_frame(sequence))]:
            found = synchronise(shifted, source="motion")
            # which of two cameras is the late one nobody can know
            got = found[1].steps - found[0].steps
            good, total = good + (abs(got - late) <= 1.0), total + 1
            say(f"{sequence.name}: late by {late} frames, found {got:.1f}")
    say(f"{good} of {total} offsets within 1 frame")


if __name__ == "__main__":
    offsets()
    mistakes()

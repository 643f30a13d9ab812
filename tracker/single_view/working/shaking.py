"""Does a camera shake: its stand is weak, or somebody holds it."""

from __future__ import annotations

from tracker.parameters import RunParameters, with_values
from tracker.sequences.finding import Check, absent, good, warning
from tracker.sequences.pictures.frames import FrameReader, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.working.sequence import Working

_NAME = "cameras hold still"


def check_shake(sequence: Sequence, reader: Pictures | None = None) -> list[Check]:
    """Which cameras shake by more than a run puts up with, ``pictures.steady_from``.

    Args:
        sequence: As it was read.
        reader: Of its pictures; one is opened if none is given.

    Returns:
        A warning for each that does; one check where none does, or where nobody can tell.

    Raises:
        OSError: If a picture file cannot be read.
    """
    if not sequence.has_pictures:
        return [absent(_NAME, "it needs pictures of every camera")]
    if reader is None:
        with FrameReader(sequence) as opened:
            return check_shake(sequence, opened)
    parameters = with_values(RunParameters(), {"single_view": "shapes"})  # it needs no templates
    working = Working.of(sequence, parameters, reader)
    found = []
    for number, camera in enumerate(sequence.cameras):
        shake = working.shake(number)
        if shake > 0.0:
            found.append(
                warning(
                    _NAME,
                    f'camera "{camera.name}" shakes by {shake:.1f} pixels; a run holds its '
                    "pictures still, but places are the less exact the more it turns: mount it "
                    "firmly",
                    shake=shake,
                )
            )
    return found or [good(_NAME, "no camera is seen to shake")]

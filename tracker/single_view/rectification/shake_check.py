"""Check for cameras that shake, on a weak stand or in a hand."""

from __future__ import annotations

from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.finding import Check, absent, good, warning
from tracker.sequences.pictures.frames import FrameReader, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.rectification.sequence import RectifiedSequence

_NAME = "cameras hold still"


def check_shake(sequence: Sequence, reader: Pictures | None = None) -> list[Check]:
    """Find the cameras that shake by more than a run tolerates, ``pictures.steady_from``.

    Args:
        sequence: The sequence.
        reader: Reader of its images; None to open one.

    Returns:
        A warning for each camera that shakes; one check without any, or if it is unknown.

    Raises:
        OSError: If an image file cannot be read.
    """
    if not sequence.has_pictures:
        return [absent(_NAME, "it needs pictures of every camera")]
    if reader is None:
        with FrameReader(sequence) as opened:
            return check_shake(sequence, opened)
    parameters = with_values(RunParameters(), {"single_view": "shapes"})  # it needs no templates
    rectified = RectifiedSequence.of(sequence, parameters, reader)
    found = []
    for number, camera in enumerate(sequence.cameras):
        shake = rectified.shake(number)
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

"""Stage 1: what each camera sees by itself. One protocol, one file a method."""

from __future__ import annotations

from tracker.parameters import METHODS, RunParameters
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.association_matrix.method import AssociationMatrix
from tracker.single_view.colour_phd import ColourPhd
from tracker.single_view.detection_phd import DetectionPhd
from tracker.single_view.jpda import Jpda
from tracker.single_view.none import DetectionBoxes
from tracker.single_view.protocol import SingleViewMethod, ViewResult
from tracker.single_view.pseudo_particle.method import PseudoParticle

__all__ = ["SingleViewMethod", "ViewResult", "create"]


def create(
    name: str,
    sequence: Sequence,
    camera_index: int,
    parameters: RunParameters,
    reader: FrameReader,
) -> SingleViewMethod:
    """The single-view method of that name, prepared for one camera of a sequence.

    Raises:
        ValueError: If there is no such method, or the sequence lacks what it needs.
    """
    if name == "colour_phd":
        return ColourPhd(
            sequence, camera_index, parameters.colour_phd, parameters.foreground, reader
        )
    if name == "association_matrix":
        return AssociationMatrix(
            sequence, camera_index, parameters.association_matrix, parameters.foreground, reader
        )
    if name == "jpda":
        return Jpda(sequence, camera_index, parameters, reader)
    if name == "detection_phd":
        return DetectionPhd(sequence, camera_index, parameters.detection_phd)
    if name == "pseudo_particle":
        return PseudoParticle(
            sequence, camera_index, parameters.pseudo_particle, parameters.foreground, reader
        )
    if name == "none":
        return DetectionBoxes(sequence, camera_index, parameters.detection_boxes)
    expected = ", ".join(METHODS["single_view"])
    raise ValueError(f"single_view: expected one of {expected}, got {name!r}")

"""Stage 1: detection and tracking in each camera by itself. One protocol, one file a method.

The methods are described in :mod:`tracker.parameters.groups` and chosen in :func:`maker`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tracker.single_view.protocol import SingleViewMethod, ViewResult

if TYPE_CHECKING:
    from tracker.parameters import Method
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures
    from tracker.sequences.sequence import Sequence

__all__ = ["SingleViewMethod", "ViewResult", "create", "maker"]


def maker(method: Method) -> Callable[..., SingleViewMethod]:
    """The class of a method of stage 1, which is imported only when it is chosen."""
    match method.name:
        case "colour_phd":
            from tracker.single_view.colour_phd import ColourPhd

            return ColourPhd
        case "shapes":
            from tracker.single_view.shape.method import ShapesInCamera

            return ShapesInCamera
        case "jpda":
            from tracker.single_view.jpda.method import Jpda

            return Jpda
        case "pseudo_particle":
            from tracker.single_view.pseudo_particle.method import PseudoParticle

            return PseudoParticle
        case "association_matrix":
            from tracker.single_view.association_matrix.method import AssociationMatrix

            return AssociationMatrix
        case "onnx_detector":
            from tracker.single_view.onnx.method import OnnxDetector

            return OnnxDetector
        case "detection_phd":
            from tracker.single_view.detection_phd import DetectionPhd

            return DetectionPhd
        case "none":
            from tracker.single_view.detector_boxes import UnfilteredBoxes

            return UnfilteredBoxes
    return method.load()


def create(
    name: str,
    sequence: Sequence,
    camera_index: int,
    parameters: RunParameters,
    reader: Pictures,
) -> SingleViewMethod:
    """Create a single-view method for one camera of a sequence.

    Raises:
        ValueError: If there is no such method, or the sequence lacks data that it needs.
    """
    from tracker.parameters.catalogue import (
        method_of,  # with those of other packages, which import this
    )

    make = maker(method_of("single_view", name))
    return make(sequence, camera_index, parameters, reader)

"""The methods that can be chosen, and all groups of parameters of a run."""

from __future__ import annotations

from typing import Literal

from tracker.parameters.association_matrix import AssociationMatrixParams
from tracker.parameters.colour_phd import ColourPhdParams
from tracker.parameters.definition import Params
from tracker.parameters.detections import DetectionBoxParams, DetectionPhdParams
from tracker.parameters.foreground import ForegroundParams
from tracker.parameters.fusion import FusionParams
from tracker.parameters.jpda import JpdaParams
from tracker.parameters.pseudo_particle import PseudoParticleParams
from tracker.parameters.smoothing import SmoothingParams

SingleViewName = Literal[
    "colour_phd", "jpda", "pseudo_particle", "association_matrix", "detection_phd", "none"
]
FusionName = Literal["sequential_phd", "multi_bernoulli"]
SmoothingName = Literal["none", "positions", "identities"]


FOREGROUND_METHODS: frozenset[SingleViewName] = frozenset(
    {"colour_phd", "pseudo_particle", "association_matrix"}
)
"""The single-view methods that ask what in a picture is foreground."""


class RunParameters(Params):
    """Everything that a run depends on, besides the sequence and the seed."""

    single_view: SingleViewName = "colour_phd"
    """Method of stage 1: boxes from each camera's pictures, or a detector's, filtered or not."""

    fusion_method: FusionName = "sequential_phd"
    """Method of stage 2: how the cameras' boxes become 3D positions."""

    smoothing_method: SmoothingName = "identities"
    """Method of stage 3: the filter's tracks as they are; each smoothed; or who is who as well."""

    colour_phd: ColourPhdParams = ColourPhdParams()
    jpda: JpdaParams = JpdaParams()
    pseudo_particle: PseudoParticleParams = PseudoParticleParams()
    association_matrix: AssociationMatrixParams = AssociationMatrixParams()
    detection_boxes: DetectionBoxParams = DetectionBoxParams()
    detection_phd: DetectionPhdParams = DetectionPhdParams()
    foreground: ForegroundParams = ForegroundParams()
    fusion: FusionParams = FusionParams()
    smoothing: SmoothingParams = SmoothingParams()

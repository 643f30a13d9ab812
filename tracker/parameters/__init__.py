"""Every tunable number, once: default, range, unit, symbol, help and stage.

From these definitions come the sliders, the command-line flags, the table of
``multiview-phd parameters``, the schema of the API and the cache keys.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021. A field's ``published`` value is the one of that paper,
where ours differs.
"""

from __future__ import annotations

from tracker.parameters.association_matrix import AssociationMatrixParams
from tracker.parameters.changing import (
    ParameterError,
    changed,
    stage_values,
    value,
    with_values,
)
from tracker.parameters.colour_phd import ColourPeakParams, ColourPhdParams
from tracker.parameters.definition import Params, Stage
from tracker.parameters.detections import DetectionBoxParams, DetectionPhdParams
from tracker.parameters.foreground import ForegroundParams
from tracker.parameters.fusion import FusionParams
from tracker.parameters.jpda import JpdaParams
from tracker.parameters.pseudo_particle import PseudoParticleParams
from tracker.parameters.run import FusionName, RunParameters, SingleViewName, SmoothingName
from tracker.parameters.smoothing import SmoothingParams
from tracker.parameters.table import GROUPS, METHODS, PARAMETERS, PRESETS, Parameter

__all__ = [
    "GROUPS",
    "METHODS",
    "PARAMETERS",
    "PRESETS",
    "AssociationMatrixParams",
    "ColourPeakParams",
    "ColourPhdParams",
    "DetectionBoxParams",
    "DetectionPhdParams",
    "ForegroundParams",
    "FusionName",
    "FusionParams",
    "JpdaParams",
    "Parameter",
    "ParameterError",
    "Params",
    "PseudoParticleParams",
    "RunParameters",
    "SingleViewName",
    "SmoothingName",
    "SmoothingParams",
    "Stage",
    "changed",
    "stage_values",
    "value",
    "with_values",
]

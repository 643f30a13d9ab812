"""Every tunable number, once: default, range, unit, symbol, help and stage.

From these definitions come the sliders, the command-line flags, the table of
``multiview-phd parameters``, the schema of the API and the cache keys.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021. A field's ``published`` value is the one of that paper,
where the default differs from it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tracker.parameters.definition import Params, Stage, ui
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.parameters.groups.colour_phd import ColourPeakParams, ColourPhdParams
from tracker.parameters.groups.detections import DetectionBoxParams, DetectionPhdParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.fusion import FusionParams
from tracker.parameters.groups.jpda import JpdaParams
from tracker.parameters.groups.onnx_detector import OnnxDetectorParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.parameters.groups.shapes import ShapesParams
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.parameters.methods import Method, MethodKey, Reads, Uses

if TYPE_CHECKING:
    from tracker.parameters.changing import ParameterError, changed, value, with_values
    from tracker.parameters.reading import shown_keys, stage_values
    from tracker.parameters.registry import FOLLOWS, PluginWarning
    from tracker.parameters.run import RunParameters
    from tracker.parameters.table import GROUPS, METHODS, PARAMETERS, PRESETS, Parameter, method_of

__all__ = [
    "FOLLOWS",
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
    "FusionParams",
    "JpdaParams",
    "Method",
    "MethodKey",
    "OnnxDetectorParams",
    "Parameter",
    "ParameterError",
    "Params",
    "PluginWarning",
    "PseudoParticleParams",
    "Reads",
    "RunParameters",
    "ShapesParams",
    "SmoothingParams",
    "Stage",
    "Uses",
    "changed",
    "method_of",
    "shown_keys",
    "stage_values",
    "ui",
    "value",
    "with_values",
]

_MADE_OF_ALL_METHODS = {
    "FOLLOWS": "registry",
    "PluginWarning": "registry",
    "RunParameters": "run",
    "GROUPS": "table",
    "METHODS": "table",
    "PARAMETERS": "table",
    "PRESETS": "table",
    "Parameter": "table",
    "method_of": "table",
    "ParameterError": "changing",
    "changed": "changing",
    "value": "changing",
    "with_values": "changing",
    "shown_keys": "reading",
    "stage_values": "reading",
}
"""The module of each name that is imported at its first use. These modules import the methods of
plugins, which themselves import :class:`Params` and :class:`Method` from here."""


def __getattr__(name: str) -> Any:
    if name not in _MADE_OF_ALL_METHODS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_MADE_OF_ALL_METHODS[name]}")
    found = globals()[name] = getattr(module, name)
    return found

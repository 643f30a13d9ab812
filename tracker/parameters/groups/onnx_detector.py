"""Parameters of the single-view method that runs a detection network."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tracker.parameters.definition import ui
from tracker.parameters.groups.detections import DetectionBoxParams
from tracker.parameters.method import Method, Reads, Uses


class OnnxDetectorParams(DetectionBoxParams):
    """Single-view boxes of a detection network (ONNX) that is run on the pictures."""

    score_threshold: Annotated[
        float, Field(ge=0.0, le=1.0), ui("s_min", "Clutter", step=0.01, essential=True)
    ] = 0.35
    """Boxes with a lower score are left out."""

    suppression_overlap: Annotated[
        float, Field(ge=0.05, le=0.99), ui("o_s", step=0.01, essential=True)
    ] = 0.6
    """Of two boxes with a larger intersection over union the one with the higher score remains."""

    person_class: Annotated[int, Field(ge=-1, le=1000), ui("c", step=1, advanced=True)] = -1
    """Which of the network's classes are people, counted from 0; -1: by the kind of network."""

    input_side: Annotated[
        int, Field(ge=64, le=2048), ui("n_in", unit="px", step=32, advanced=True)
    ] = 640
    """Side of the network's picture, where its file leaves that open."""

    pixel_values: Annotated[
        Literal["unit", "imagenet", "signed", "bytes"], ui("v", advanced=True)
    ] = "unit"
    """Range of the network's input: 0 … 1 (YOLO, RT-DETR), ImageNet's (DETR), −1 … 1, or 0 …
    255."""


_PICTURES = Reads("pictures", without=frozenset({"steady_from"}))  # needs no fixed background

METHOD = Method(
    name="onnx_detector",
    help="The boxes of a detection network of your own (ONNX), without a filter in the picture.",
    uses=Uses(pictures=True, detector=True, reads=(Reads("onnx_detector"), _PICTURES)),
    parameters=OnnxDetectorParams,
)

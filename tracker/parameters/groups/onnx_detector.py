"""Parameters of the single-view method that runs a detection network."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tracker.parameters.definition import Params, ui
from tracker.parameters.method import Method, Reads, Uses, Values


class OnnxDetectorParams(Params):
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
        int, Field(ge=0, le=2048), ui("n_in", unit="px", step=32, advanced=True)
    ] = 0
    """Longer side of the network's picture, where its file leaves that open; 0: as the file says,
    416 for the fetched network, or else 640. The more, the smaller people may be, and the longer it
    takes."""

    every: Annotated[int, Field(ge=1, le=10), ui("n_e", unit="steps", step=1)] = 1
    """The network looks at every n-th picture; those between are no evidence for or against
    people."""

    pixel_values: Annotated[
        Literal["file", "unit", "imagenet", "signed", "bytes", "imagenet_bgr"],
        ui("v", advanced=True),
    ] = "file"
    """Range of the network's input: as its file says, or else 0 … 1; 0 … 1 (YOLO, RT-DETR),
    ImageNet's (DETR), −1 … 1, 0 … 255, or ImageNet's with blue first (NanoDet)."""


_BOXES = Reads("detection_boxes", without=frozenset({"score_threshold"}))
"""A network's boxes have the noise of every detector's, and a least score of their own."""

_PICTURES = Reads(
    "pictures", without=frozenset({"lines", "target_height", "least_height", "steady_from"})
)
"""The network's input is scaled from the full picture, and it needs no fixed background."""


def _uses(values: Values) -> Uses:
    return Uses(
        pictures=True,
        detector=True,
        every=values.of(OnnxDetectorParams).every,
        reads=(Reads("onnx_detector"), _BOXES, _PICTURES),
    )


METHOD = Method(
    name="onnx_detector",
    help="The boxes of a detection network (ONNX), without a filter in the picture.",
    uses=_uses,
    parameters=OnnxDetectorParams,
)

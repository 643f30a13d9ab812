"""The route of the foreground: what of a picture a single-view method took for people."""

from __future__ import annotations

import cv2
import numpy as np
from fastapi import APIRouter, Response
from jaxtyping import UInt8
from numpy import ndarray

from app.state.snapshot import Snapshot
from app.web.dependencies import ERRORS, Bench
from app.web.pictures.address import Kept, checked, missing, png
from tracker.single_view.pictures.background import unpack

TINT = (214, 100, 244)
"""Blue, green, red: a magenta that neither rooms nor the ids' colours have."""

INSIDE, BORDER = 84, 235
"""Opacity of 255: the picture is seen through the foreground, its outline stands out."""

_missing = missing("no_foreground")

router = APIRouter(prefix="/api", responses=ERRORS)


@router.get(
    "/foreground/{sequence_key}/{camera}/{step}.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}, "description": "The tinted foreground."}},
)
def foreground(
    bench: Bench,
    sequence_key: str,
    camera: int,
    step: int,
    run: Kept = None,
) -> Response:
    """One camera's foreground at one step of the shown run, to be laid over its picture."""
    mask = _mask(bench.snapshot(), sequence_key, camera, step, run)
    return png(tinted(mask), run)


def tinted(mask: UInt8[ndarray, "h w"]) -> bytes:
    """A transparent PNG: the foreground tinted, with its outline."""
    picture = np.empty((*mask.shape, 4), dtype=np.uint8)
    picture[:, :, :3] = TINT
    inner = cv2.erode(mask, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    picture[:, :, 3] = np.where(inner > 0, INSIDE, np.where(mask > 0, BORDER, 0))
    done, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 2])
    assert done, "a picture of four channels can be written as PNG"
    return bytes(data)


def _mask(
    snapshot: Snapshot, sequence_key: str, camera: int, step: int, wanted: str | None
) -> UInt8[ndarray, "h w"]:
    sequence, _ = checked(snapshot, sequence_key, camera, step, _missing)
    run = snapshot.run
    if run is None or step >= run.done:
        raise _missing(f"Step {step} is not computed yet.", "Ask again when the run is there.")
    if wanted is not None and wanted != run.keys.get("single_view"):
        raise _missing("That run is not shown any more.", "Ask for the step again.")
    packed = run.views[step][camera].foreground if step < len(run.views) else None
    if packed is None:
        name, method = sequence.views[camera].camera.name, run.parameters.single_view
        raise _missing(
            f'There is no foreground of camera "{name}" at step {step}: {method} had no picture '
            "there, or looks at none.",
            "Choose a single-view method that looks at pictures.",
        )
    return unpack(packed)

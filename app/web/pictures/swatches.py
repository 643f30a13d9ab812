"""What a template's box holds, as pictures: the part of the picture, and its colours as bars."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from app.state.snapshot import Snapshot
from app.web.pictures.address import checked, missing, picture_of
from tracker.geometry.boxes import Boxes
from tracker.single_view.pictures import colour

CROP_HEIGHT = 88
"""Pixels: twice what the page shows, for fine screens."""

HUES, SHADES = 16, 16
BAR, GAP, HEIGHT = 5, 1, 40
"""Of the bars, in units of the drawing."""

RELOAD = "Load the page again."

_missing = missing("no_swatch")


class Swatches:
    """Reads boxes of the open sequence's pictures."""

    def crop(
        self, snapshot: Snapshot, sequence_key: str, camera: int, step: int, box: str
    ) -> bytes:
        """The part of the picture as PNG.

        Raises:
            ApiError: If there is no such picture, or the box lies outside.
        """
        picture, (left, top, width, height) = _picture(snapshot, sequence_key, camera, step, box)
        rows = slice(max(0, round(top)), max(0, round(top + height)))
        columns = slice(max(0, round(left)), max(0, round(left + width)))
        part = picture[rows, columns]
        if part.size == 0:
            raise _missing(f"The box {box} lies outside the picture.", RELOAD)
        size = (max(1, round(part.shape[1] * CROP_HEIGHT / part.shape[0])), CROP_HEIGHT)
        shown = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
        done, data = cv2.imencode(".png", shown)
        assert done, "a picture of three channels can be written as PNG"
        return bytes(data)

    def histogram(
        self, snapshot: Snapshot, sequence_key: str, camera: int, step: int, box: str
    ) -> str:
        """The colour histogram in ``hue_saturation`` bins, summed over the saturation, as SVG.

        Raises:
            ApiError: If there is no such picture.
        """
        picture, left_top = _picture(snapshot, sequence_key, camera, step, box)
        place = Boxes.from_left_top(np.array([left_top], dtype=float)).centred
        bins = colour.bin_map(picture, "hue_saturation")
        found = colour.histograms(bins, place, "hue_saturation", "epanechnikov")[0]
        return bars(found)


def bars(histogram: Float[ndarray, " bins"]) -> str:
    """A bar a hue in its colour, then a bar a grey, each as high as its share.

    Args:
        histogram: In ``hue_saturation`` bins, summing to 1.
    """
    hues = histogram[: HUES * 16].reshape(HUES, 16)
    shares = np.concatenate([hues.sum(axis=1), histogram[HUES * 16 :]])
    levels = (np.arange(16) + 0.5) / 16.0
    weights = np.maximum(hues.sum(axis=1), 1e-12)
    saturations = (hues @ levels) / weights
    colours = [
        f"hsl({(k + 0.5) * 360 / HUES:.0f} {60 + 40 * saturations[k]:.0f}% 52%)"
        for k in range(HUES)
    ] + [f"hsl(0 0% {100 * (k + 0.5) / SHADES:.0f}%)" for k in range(SHADES)]
    highest = max(float(shares.max()), 1e-12)
    drawn = []
    for k, (share, fill) in enumerate(zip(shares, colours, strict=True)):
        if share > 0.002:
            size = max(1.5, (HEIGHT - 2) * float(share) / highest)
            x = k * (BAR + GAP) + (3 * GAP if k >= HUES else 0)
            drawn.append(
                f'<rect x="{x}" y="{HEIGHT - 1 - size:.1f}" width="{BAR}" height="{size:.1f}" '
                f'fill="{fill}" stroke="#888" stroke-width=".5"/>'
            )
    width = (HUES + SHADES) * (BAR + GAP) + 3 * GAP
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}">'
        f'<path d="M0 {HEIGHT - 0.5}H{width}" stroke="#888" stroke-width="1"/>'
        f"{''.join(drawn)}</svg>"
    )


def _picture(
    snapshot: Snapshot, sequence_key: str, camera: int, step: int, box: str
) -> tuple[UInt8[ndarray, "h w 3"], tuple[float, float, float, float]]:
    sequence, reader = checked(snapshot, sequence_key, camera, step, _missing)
    try:
        left, top, width, height = (float(part) for part in box.split(","))
        if not all(abs(value) < 1e5 for value in (left, top, width, height)):
            raise ValueError
    except ValueError:
        words = f"A box is left,top,width,height in pixels, found {box[:60]!r}."
        raise _missing(words, RELOAD) from None
    picture = picture_of(sequence, reader, camera, step, _missing)
    return picture, (left, top, width, height)

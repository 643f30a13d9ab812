"""What a sequence was taught: the routes, the detector, pictures of templates."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from fastapi import APIRouter, Response
from jaxtyping import Float, UInt8
from numpy import ndarray

from app.errors import as_sentence
from app.messages import Box, GivenPath, Model, Vector
from app.state.snapshot import Snapshot
from app.state.tasks import DetectorFetching
from app.web import results
from app.web.commands import NOTHING_LOST, refusing
from app.web.dependencies import (
    ERRORS,
    FOR_EVER,
    Bench,
    Owned,
    Work,
    a_file,
    begun,
    of_app,
    opened,
    told_in_the_answer,
)
from app.web.pictures import checked, missing, picture_of
from app.web.results import State
from tracker.geometry.boxes import Boxes
from tracker.parameters.catalogue import METHODS, method_of
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.reader import WHERE_NOW, why_missing
from tracker.sequences.sequence import PRESETS, Sequence, Template
from tracker.sequences.writing.teaching import changes, taught_values
from tracker.single_view.pictures import colour


class DetectorRequest(Model):
    """A detection network for the pictures."""

    model: GivenPath | None = None
    """The path of an ONNX file on this machine; none takes the one away that there is."""


class TemplateInfo(Model):
    """A box whose colours model a person."""

    name: str
    camera: str
    """The camera's name."""
    step: int
    box: Box


class OfferInfo(Model):
    """A template that the tracks offer."""

    template: TemplateInfo
    track: int
    reason: str
    """What speaks for it."""


class DetectorInfo(Model):
    """A detection network that is at hand."""

    name: str
    path: str | None
    """The file that somebody named for this recording; null for a fetched network."""


class Taught(Model):
    """What the open sequence was taught; room, entrances and target are in its state."""

    templates: list[TemplateInfo]
    offers: list[OfferInfo] | None
    """Null before they are asked for."""
    method: str
    """The single-view method in use."""
    looking: str | None
    """A method that looks at templates, where that in use does not."""
    detector: DetectorInfo | None
    fetching: int | None
    """Percentage of a network that is being fetched."""
    sizes: dict[str, Vector]
    """Half width, depth and height of common targets in metres, by their words."""
    unsaved: list[str]
    """What the sequence's file does not have, in words."""
    file: str
    """The sequence's file, with its folder."""
    read_only: str | None
    """Why it can only be saved as a copy; null where it can be saved."""
    remark: str | None
    """The reason why its file is not as it was when opened or saved; null where it is."""
    built_in: bool
    copy_to: str
    """A folder that is not there yet, to be offered for a copy."""


CROP_HEIGHT = 88
"""Pixels: twice what the page shows, for fine screens."""

HUES, SHADES = 16, 16
BAR, GAP, HEIGHT = 5, 1, 40
"""Of the bars, in units of the drawing."""

RELOAD = "Load the page again."

_missing = missing("no_swatch")


def crop(snapshot: Snapshot, sequence_key: str, camera: int, step: int, box: str) -> bytes:
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


def bars_of(snapshot: Snapshot, sequence_key: str, camera: int, step: int, box: str) -> str:
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


router = APIRouter(prefix="/api/teach", responses=ERRORS)

Fetching = Annotated[DetectorFetching, of_app("detector_fetching")]


def _remark_on(sequence: Sequence) -> str | None:
    """Whether the file of a sequence was changed, moved or deleted by somebody else."""
    own = sequence.own_file
    if own is None or own.is_same:
        return None
    if why := why_missing(sequence.folder):
        return as_sentence(f"{why}; {WHERE_NOW}")
    return f"{own.path.name} was changed by another program: open the recording again."


@router.get("")
def taught(bench: Bench, owners: Owned) -> Taught:
    """What the open sequence was taught, what its tracks offer, and how it can be saved."""
    snapshot, sequence = opened(bench)
    saved, parameters = snapshot.saved or sequence, snapshot.parameters

    def looks(method: str) -> bool:
        return method_of("single_view", method).used(parameters).templates != "no"

    method = parameters.single_view
    offered = None
    if snapshot.offers is not None:
        offered = [
            OfferInfo(template=_template(one.template), track=one.track, reason=one.reason)
            for one in owners.teaching.offered()
        ]
    network = sequence.detector
    detector = None
    if network is not None:
        path = str(network.path) if network.named else None
        detector = DetectorInfo(name=network.name, path=path)
    return Taught(
        templates=[_template(template) for template in sequence.templates],
        offers=offered,
        method=method,
        looking=None if looks(method) else next(filter(looks, METHODS["single_view"])),
        detector=detector,
        fetching=snapshot.fetching,
        sizes=dict(PRESETS),
        unsaved=changes(taught_values(saved), taught_values(sequence)),
        file=f"{sequence.folder.name}/sequence.toml",
        # a folder that is not there cannot be copied either
        read_only=None if why_missing(sequence.folder) else owners.teaching.why_not_in_place(),
        remark=_remark_on(sequence),
        built_in=bool(opens_by_name(sequence.folder)),
        copy_to=str(owners.teaching.copy_folder()),
    )


def _template(template: Template) -> TemplateInfo:
    left, top, width, height = template.box.tolist()
    return TemplateInfo(
        name=template.name,
        camera=template.camera,
        step=template.frame,
        box=(left, top, width, height),
    )


@router.put("/detector")
async def use_detector(wish: DetectorRequest, bench: Bench, jobs: Work) -> State:
    """Find people by a detection network of this machine, or no more; the run follows."""
    opened(bench)
    model = None if wish.model is None else Path(wish.model).expanduser()
    if model is not None:
        from tracker.single_view.onnx.network import Network  # at its first use

        with refusing():
            await asyncio.to_thread(Network.tried, model)
    with told_in_the_answer("the detector", field="model", hint=NOTHING_LOST):
        await begun(jobs.use_detector(model))
    return results.state_of(bench.snapshot())


@router.post("/detector/fetched")
def fetch_detector(fetching: Fetching, bench: Bench) -> State:
    """Fetch a detection network with npm, in the background, and use it for this recording."""
    fetching.start()
    return results.state_of(bench.snapshot())


@router.delete("/detector/fetched")
def stop_fetching(fetching: Fetching, bench: Bench) -> State:
    """Stop fetching a detection network; nothing of it is kept."""
    fetching.cancel()
    return results.state_of(bench.snapshot())


@router.get(
    "/swatch/{sequence_key}/{camera}/{step}/{box}.png", **a_file("image/png", "What the box holds.")
)
def swatch(bench: Bench, sequence_key: str, camera: int, step: int, box: str) -> Response:
    """The part of a picture in a box: ``left,top,width,height``."""
    png = crop(bench.snapshot(), sequence_key, camera, step, box)
    return Response(png, media_type="image/png", headers={"cache-control": FOR_EVER})


@router.get(
    "/histogram/{sequence_key}/{camera}/{step}/{box}.svg",
    **a_file("image/svg+xml", "A bar a colour."),
)
def histogram(bench: Bench, sequence_key: str, camera: int, step: int, box: str) -> Response:
    """The colours in a box, as the colour methods weigh them: hues, then greys by value."""
    svg = bars_of(bench.snapshot(), sequence_key, camera, step, box)
    return Response(svg, media_type="image/svg+xml", headers={"cache-control": FOR_EVER})

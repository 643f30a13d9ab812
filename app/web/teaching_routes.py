"""The routes of teaching: what was taught, the detector, pictures of templates."""

from __future__ import annotations

import asyncio
from pathlib import Path

from fastapi import APIRouter, Request, Response

from app import models
from app.models.teaching import (
    DetectorInfo,
    DetectorRequest,
    OfferInfo,
    Taught,
    TemplateInfo,
)
from app.state.workers.fetching import DetectorFetching
from app.web.commands.teaching import NOTHING_LOST, refusing
from app.web.dependencies import ERRORS, FOR_EVER, Bench, Owned, Work, nothing_open
from app.web.opening import begun, told_in_the_answer
from app.web.pictures.swatches import Swatches
from app.web.views import results
from tracker.parameters.catalogue import METHODS, method_of
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.sequence import PRESETS, Template
from tracker.sequences.writing.teaching import changes, taught_values

router = APIRouter(prefix="/api/teach", responses=ERRORS)


@router.get("")
def taught(bench: Bench, owners: Owned) -> Taught:
    """What the open sequence was taught, what its tracks offer, and how it can be saved."""
    snapshot = bench.snapshot()
    sequence, saved, parameters = snapshot.sequence, snapshot.saved, snapshot.parameters
    if sequence is None or saved is None:
        raise nothing_open()

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
        read_only=owners.teaching.why_not_in_place(),
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
async def use_detector(wish: DetectorRequest, bench: Bench, jobs: Work) -> models.State:
    """Find people by a detection network of this machine, or no more; the run follows."""
    if bench.snapshot().sequence is None:
        raise nothing_open()
    model = None if wish.model is None else Path(wish.model).expanduser()
    if model is not None:
        from tracker.single_view.onnx.network import Network  # at its first use

        with refusing():
            await asyncio.to_thread(Network.tried, model)
    with told_in_the_answer("the detector", field="model", hint=NOTHING_LOST):
        await begun(jobs.use_detector(model))
    return results.state_of(bench.snapshot())


@router.post("/detector/fetched")
def fetch_detector(request: Request, bench: Bench) -> models.State:
    """Fetch a detection network with npm, in the background, and use it for this recording."""
    fetching: DetectorFetching = request.app.state.detector_fetching
    fetching.start()
    return results.state_of(bench.snapshot())


@router.delete("/detector/fetched")
def stop_fetching(request: Request, bench: Bench) -> models.State:
    """Stop fetching a detection network; nothing of it is kept."""
    fetching: DetectorFetching = request.app.state.detector_fetching
    fetching.cancel()
    return results.state_of(bench.snapshot())


@router.get(
    "/swatch/{sequence_key}/{camera}/{step}/{box}.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}, "description": "What the box holds."}},
)
def swatch(
    request: Request, bench: Bench, sequence_key: str, camera: int, step: int, box: str
) -> Response:
    """The part of a picture in a box: ``left,top,width,height``."""
    swatches: Swatches = request.app.state.swatches
    png = swatches.crop(bench.snapshot(), sequence_key, camera, step, box)
    return Response(png, media_type="image/png", headers={"cache-control": FOR_EVER})


@router.get(
    "/histogram/{sequence_key}/{camera}/{step}/{box}.svg",
    response_class=Response,
    responses={200: {"content": {"image/svg+xml": {}}, "description": "A bar a colour."}},
)
def histogram(
    request: Request, bench: Bench, sequence_key: str, camera: int, step: int, box: str
) -> Response:
    """The colours in a box, as the colour methods weigh them: hues, then greys by value."""
    swatches: Swatches = request.app.state.swatches
    svg = swatches.histogram(bench.snapshot(), sequence_key, camera, step, box)
    return Response(svg, media_type="image/svg+xml", headers={"cache-control": FOR_EVER})

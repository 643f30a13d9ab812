"""The routes of teaching: templates, the room, entrances; saving."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FolderPath
from typing import Annotated

from fastapi import APIRouter, Depends, Path, Request, Response

from app import models
from app.errors import ApiError, as_sentence, sentence
from app.models.teaching import (
    CopyRequest,
    DetectorInfo,
    DetectorRequest,
    EditingChange,
    NewEntrance,
    NewTemplate,
    OfferInfo,
    TargetChange,
    Taught,
    TemplateInfo,
    TextChange,
    ValueChange,
)
from app.state.teaching import Part, Side, Teaching
from app.state.workers.fetching import DetectorFetching
from app.web.dependencies import ERRORS, FOR_EVER, Bench, Work, nothing_open
from app.web.opening import begun, told_in_the_answer
from app.web.pictures.swatches import Swatches
from app.web.views import results
from tracker.parameters.catalogue import METHODS, method_of
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.sequence import PRESETS, Template
from tracker.sequences.writing.teaching import changes, taught_values

NOTHING_LOST = "Nothing was changed, and nothing is lost."

router = APIRouter(prefix="/api/teach", responses=ERRORS)


def _teaching(request: Request) -> Teaching:
    teaching: Teaching = request.app.state.teaching
    return teaching


Teach = Annotated[Teaching, Depends(_teaching)]
Axis = Annotated[int, Path(ge=0, le=2, description="0, 1, 2 for x, y, z.")]


@contextmanager
def _complaining(code: str = "cannot_teach") -> Iterator[None]:
    """What does not fit, in the one shape of errors."""
    try:
        yield
    except (ValueError, OSError) as error:
        raise ApiError(422, code, as_sentence(sentence(error)), hint=NOTHING_LOST) from None


@router.get("")
def taught(bench: Bench, teach: Teach) -> Taught:
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
            for one in teach.offered()
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
        read_only=teach.why_not_in_place(),
        built_in=bool(opens_by_name(sequence.folder)),
        copy_to=str(teach.copy_folder()),
    )


def _template(template: Template) -> TemplateInfo:
    left, top, width, height = template.box.tolist()
    return TemplateInfo(
        name=template.name,
        camera=template.camera,
        step=template.frame,
        box=(left, top, width, height),
    )


@router.post("/templates")
def add_template(wish: NewTemplate, bench: Bench, teach: Teach) -> models.State:
    """Add a box whose colours model a person; the run follows at once."""
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    step = snapshot.playhead if wish.step is None else wish.step
    with _complaining():
        box = (wish.left, wish.top, wish.width, wish.height)
        teach.add_template(wish.camera, step, box, wish.name or None)
    return results.state_of(bench.snapshot())


@router.post("/offers")
def offer_templates(bench: Bench, teach: Teach) -> models.State:
    """List the templates that the tracks of the shown run offer; they change nothing yet."""
    with _complaining():
        teach.offer_templates()
    return results.state_of(bench.snapshot())


@router.post("/offers/taken")
def take_all_offers(bench: Bench, teach: Teach) -> models.State:
    """Add all templates that are offered; the run follows at once."""
    with _complaining():
        teach.take_offers()
    return results.state_of(bench.snapshot())


@router.post("/offers/{index}/taken")
def take_offer(index: int, bench: Bench, teach: Teach) -> models.State:
    """Add an offered template to the others; the run follows at once."""
    with _complaining():
        teach.take_offers(index)
    return results.state_of(bench.snapshot())


@router.delete("/offers")
def forget_offers(bench: Bench, teach: Teach) -> models.State:
    """List no offered templates any more."""
    with _complaining():
        teach.forget_offers()
    return results.state_of(bench.snapshot())


@router.patch("/templates/{index}")
def rename_template(index: int, wish: TextChange, bench: Bench, teach: Teach) -> models.State:
    """Say whose colours a template models; templates of one name are of one person."""
    with _complaining():
        teach.rename_template(index, wish.value)
    return results.state_of(bench.snapshot())


@router.delete("/templates/{index}")
def remove_template(index: int, bench: Bench, teach: Teach) -> models.State:
    """Take a template away."""
    with _complaining():
        teach.remove_template(index)
    return results.state_of(bench.snapshot())


@router.patch("/room/{side}/{axis}")
def set_face(side: Side, axis: Axis, wish: ValueChange, bench: Bench, teach: Teach) -> models.State:
    """Move one of the room's six faces."""
    with _complaining():
        teach.set_face(side, axis, wish.value)
    return results.state_of(bench.snapshot())


@router.post("/target")
def set_target(wish: TargetChange, bench: Bench, teach: Teach) -> models.State:
    """Say how large a person is."""
    with _complaining():
        teach.set_target(wish.half_extents)
    return results.state_of(bench.snapshot())


@router.patch("/target/{axis}")
def set_target_side(axis: Axis, wish: ValueChange, bench: Bench, teach: Teach) -> models.State:
    """Say how wide, deep or tall a person is."""
    sequence = bench.snapshot().sequence
    if sequence is None:
        raise nothing_open()
    x, y, z = (
        wish.value / 2.0 if own == axis else float(half)
        for own, half in enumerate(sequence.target_half_extents)
    )
    with _complaining():
        teach.set_target((x, y, z))
    return results.state_of(bench.snapshot())


@router.post("/entrances")
def add_entrance(wish: NewEntrance, bench: Bench, teach: Teach) -> models.State:
    """Add an entrance, in the middle of the room where no place is given."""
    with _complaining():
        teach.add_entrance(wish.position)
    return results.state_of(bench.snapshot())


@router.post("/entrances/suggested")
def suggest_entrances(bench: Bench, teach: Teach) -> models.State:
    """Add the entrances at which the tracks of the shown run begin and end."""
    with _complaining():
        teach.suggest_entrances()
    return results.state_of(bench.snapshot())


@router.patch("/entrances/{index}/{part}/{axis}")
def set_entrance(
    index: int, part: Part, axis: Axis, wish: ValueChange, bench: Bench, teach: Teach
) -> models.State:
    """Move an entrance along an axis, or make it wider."""
    with _complaining():
        teach.set_entrance(index, part, {axis: wish.value})
    return results.state_of(bench.snapshot())


@router.delete("/entrances/{index}")
def remove_entrance(index: int, bench: Bench, teach: Teach) -> models.State:
    """Take an entrance away."""
    with _complaining():
        teach.remove_entrance(index)
    return results.state_of(bench.snapshot())


@router.put("/detector")
async def use_detector(wish: DetectorRequest, bench: Bench, jobs: Work) -> models.State:
    """Find people by a detection network of this machine, or no more; the run follows."""
    if bench.snapshot().sequence is None:
        raise nothing_open()
    model = None if wish.model is None else FolderPath(wish.model).expanduser()
    if model is not None:
        from tracker.single_view.onnx.network import Network  # at its first use

        with _complaining():
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


@router.post("/editing")
async def edit_room(wish: EditingChange, bench: Bench) -> models.State:
    """Have the 3D view with handles on the room, or without."""
    bench.edit_room(wish.on)
    return results.state_of(bench.snapshot())


@router.post("/discard")
def discard(bench: Bench, teach: Teach) -> models.State:
    """Have room and templates as the file has them; undo brings the changes back."""
    with _complaining():
        teach.discard()
    return results.state_of(bench.snapshot())


@router.post("/save")
def save(bench: Bench, teach: Teach) -> models.State:
    """Write what was taught into the sequence's file, with a backup beside it."""
    with _complaining("cannot_save"):
        backup = teach.save()
    bench.notify("info", f"Saved in {backup.parent.name}", f"What was there is in {backup.name}.")
    return results.state_of(bench.snapshot())


@router.post("/copy")
def save_copy(wish: CopyRequest, bench: Bench, teach: Teach) -> models.State:
    """Write the sequence with what was taught into another folder, and go on in that."""
    with _complaining("cannot_save"):
        folder = teach.save_copy(FolderPath(wish.folder.strip()))
    bench.notify("info", f"Saved a copy in {folder}", "The workbench is in the copy now.")
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

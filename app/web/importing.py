"""What pages and server tell each other of opening and importing, and the routes of both."""

from __future__ import annotations

import math
import re
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import Field

from app.errors import ApiError, as_sentence, sentence
from app.messages import GivenPath, Model, Vector, filled
from app.state.importing import (
    MOST_BYTES,
    Announced,
    Desk,
    Draft,
    ImportWish,
    Known,
    Phase,
    UploadError,
    folder_name,
    mended,
    places,
)
from app.state.recents import Recents, thumbnail
from app.web.dependencies import ERRORS, Bench, Configured, Work, of_app
from tracker.io.checks import Check, Status
from tracker.io.checks.synchronisation import CameraOffset
from tracker.io.conventions.questions import Part
from tracker.io.importing.finding.angles import open_turns, product_in_words, turns_in_words
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.remedies import unsaid
from tracker.io.read.pieces import CalibrationPiece, DetectionPiece, FormatError
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, with_values
from tracker.sequences import library
from tracker.sequences.built_in import built_in_name
from tracker.sequences.sequence import PRESETS

if TYPE_CHECKING:
    from app.state.looking import Looked
    from tracker.geometry.consistency.entrances import Door
    from tracker.io.conventions.questions import Question
    from tracker.io.importing.gathering import FileUse
    from tracker.io.importing.settling import ImportPlan, PlannedView


class AnnouncedFile(Model):
    """A file that is to come."""

    path: str = Field(max_length=4096)
    """From the folder that was dropped, with slashes; or its name alone."""
    bytes: int = Field(ge=0)


class AnnouncedFiles(Model):
    """Files that are to come."""

    files: list[AnnouncedFile] = Field(max_length=50_000)


class PathRequest(Model):
    """A folder or file on the machine that runs the workbench."""

    path: GivenPath


class WriteRequest(Model):
    """Write the recording."""

    open: bool = True
    """Open it when it is written, and so track."""


class ImportedFile(Model):
    """A file, or a series of numbered ones, and what it was taken for."""

    label: str
    format: str
    """What it was taken for; empty where it is read with another file, or not at all."""
    read_with: str
    """The label of the file that it is read with; empty for the others."""
    why: str
    """Why it is not used, as far as it is known of the file alone; else empty."""
    count: int
    """The number of files."""
    used: int
    """The number of them that the recording is made of."""


class ImportedOffset(Model):
    """How late a camera is against the others, as it is now."""

    steps: float
    seconds: float
    sharpness: float
    sure: bool
    offsets: list[float]
    """Steps that were tried."""
    agreement: list[float | None]
    """Of each; null where too little is left to compare."""


class ImportedCamera(Model):
    """A camera with what belongs to it."""

    key: str
    """Its name in the calibration."""
    name: str
    video: str
    """Name of the file, or of the folder of pictures; empty where there is none."""
    frames: int
    fps: float
    width: int
    height: int
    calibration: str
    """The file of its calibration; what it was recognised as, where it is made of several."""
    calibration_format: str
    calibration_of: str
    """The camera whose calibration it has by its file: its own, unless they are exchanged."""
    detections: str
    boxes_format: str
    boxes_per_step: float
    seconds_late: float
    """As it is wished."""
    offset: ImportedOffset | None
    """As it was found, beyond what is wished."""


class ImportedCheck(Model):
    """A check, and what mends it."""

    name: str
    status: Status
    sentence: str
    remedy: str
    """The field of the sheet and what it should be; empty where there is none."""
    mend: ImportWish | None
    """The wish that mends it; null where nothing here does."""
    cameras: list[str]
    """The keys of the cameras that do not fit the others, where it is about them."""


class ImportedPair(Model):
    """How well the boxes of two cameras meet."""

    first: str
    second: str
    share: float
    pixels: float | None
    odd: bool


class ImportedPlan(Model):
    """The room from above, metres."""

    x: float
    y: float
    cell: float
    width: int
    height: int
    seen: list[int]
    """How many cameras see the floor, by cell, rows along y."""
    entrances: list[tuple[float, float, float, float]]
    """Of those that are wished, else of those that are suggested: x, y and how wide they are."""
    cameras: list[tuple[float, float, float, float]]
    """x, y, direction and half the angle across, radians."""
    feet: list[tuple[float, float]]


class ImportQuestion(Model):
    """What is asked where the files leave open how they are meant."""

    code: Part
    """The first part of the interpretation that differs."""
    interpretations: tuple[str, str]
    """In words, the likelier one first."""
    difference: str
    chosen: tuple[str, str]
    """The fields of the sheet that each states, and how."""
    wishes: tuple[ImportWish, ImportWish]
    """What decides for each here."""


class ImportInfo(Model):
    """An import on its way."""

    key: str
    version: int
    phase: Phase
    busy: bool
    under_way: str
    """What is being looked into."""
    error: str
    undecided: str
    """Why nothing can be written before somebody decides how the files are meant; else empty."""
    question: ImportQuestion | None
    wish: ImportWish
    received: int
    """Bytes."""
    bytes: int
    files: list[ImportedFile]
    """The first of them: those that are used, then those that are not for a reason of their own."""
    files_there: int
    """The number of all files."""
    files_used: int
    """The number of those that the recording is made of."""
    coming: list[str]
    """Files that were announced and are not yet understood, the first of them."""
    offered: list[str]
    """Labels of pictures and boxes that a camera may be given."""
    uploaded: bool
    """Whether the files were sent by a page."""
    home: str
    place: str
    """The name of its folder there, which has no signs that not every file system takes."""
    free: int
    """Bytes on the disk of the recordings."""
    fps: float
    frames: int
    unit: str
    up: str
    pose: str
    axes: str
    boxes: str
    """How the four numbers of a box are meant; empty where files differ or have none."""
    first_index: str
    """The number of the first frame in files of boxes; empty where there are none."""
    turns: str
    """How rotations given by three angles were taken; empty where there are none."""
    open_turns: list[tuple[str, str]]
    """How they may be composed: what is wished, and words; what the names leave open."""
    room: tuple[Vector, Vector] | None
    suggested: tuple[Vector, Vector] | None
    half_extents: Vector | None
    suggested_half_extents: Vector | None
    entrances: list[tuple[Vector, Vector]]
    """Suggested where tracks of a first run begin and end: position, standard deviations."""
    fitting: dict[str, str]
    """What it is tracked with unless somebody wishes otherwise, by what chooses a method."""
    unfit: dict[str, dict[str, str]]
    """Methods that cannot work on it, each with the reason."""
    copied: int
    """Bytes, of the files that become its own."""
    megabytes_per_second: float
    truth: int
    """People in the truth; 0 where there is none."""
    has_boxes: bool
    """Whether every camera has boxes."""
    found: list[tuple[str, str]]
    told: list[str]
    cameras: list[ImportedCamera]
    checks: list[ImportedCheck]
    pairs: list[ImportedPair]
    plan: ImportedPlan | None
    folder: str
    """Where it was written."""
    sizes: dict[str, Vector] = PRESETS
    """Half width, depth and height of common targets in metres, by their words."""


class Begun(Model):
    """An import that was begun, or a recording that needs none."""

    draft: ImportInfo | None
    first: int = 0
    """Number of the first of the files that were announced."""
    recording: str = ""
    """The folder of a recording that is one already."""


class RecordingCard(Model):
    """A recording that can be opened."""

    name: str
    opens: str
    """What opens it."""
    kind: Literal["recent", "folder", "rendered"]
    description: str
    cameras: int
    frames: int
    fps: float
    """0 where it is not known before it is opened."""
    opened: float
    """Seconds since 1970; 0 where it never was."""
    picture: str
    """Address of its picture; empty where there is none yet."""
    open: bool
    """Whether it is what is open now."""


class Recordings(Model):
    """What can be opened at once, and what can be imported from the disk."""

    recordings: list[RecordingCard]
    folders: list[str]
    """Below the data folder, that are no recordings yet."""
    data: str
    """Where recordings go."""
    free: int
    """Bytes on that disk."""
    most: int
    """Bytes that an upload may have."""


FIELDS = {
    "--accept-best": "Import it as it is",
    "--as-named": "As named",
    "--axes": "Axes",
    "--boxes": "Boxes",
    "--euler": "Angles",
    "--first-index": "First frame",
    "--fps": "Rate",
    "--pose": "Poses",
    "--swap": "Apply",
    "--unit": "File's unit",
    "--up": "Up",
    "camera.time_offset": "Starts late by",
    "room.max": "Room",
    "room.min": "Room",
    "target.half_extents": "Target",
}
"""What the sheet of *Open* calls a flag of the import, or a field of ``sequence.toml``."""

_WHOLE = (
    (
        r"; --camera \S+=FILE(?=\)?$)",
        "; choose it in the row of its camera, or name it after its camera",
    ),
    (r"by --camera \S+=FILE", "by the name of its camera, with the others left out"),
    (r" \(`multiview-phd formats` lists them\)", ""),
    (r"timestamps in sequence\.toml", "in a file of time stamps"),
    (r"name (a video or images|a file of detections) in sequence\.toml", r"add \1"),
    (r"\[(room|target)\]", r"the \1"),
    (r" or by `[^`]*`, or start the program with --detector model\.onnx", ""),
)
"""What the page says in place of words that name more than a flag."""

_FLAG = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, FIELDS))})(?![\w-])( = |=)?")


def on_page(words: str) -> str:
    """A sentence of the import for whoever has the sheet before them, and no command line."""
    for pattern, instead in _WHOLE:
        words = re.sub(pattern, instead, words)
    words = re.sub(r"; (--[a-z-]+)$", r"; \1 changes it", words)
    return _FLAG.sub(lambda found: f"“{FIELDS[found[1]]}”{' ' if found[2] else ''}", words)


MOST_OFFSETS = 241
"""Values of a curve of agreement."""

MOST_LISTED = 200
"""Files that are named one by one."""


def _changed(wish: ImportWish, changes: Mapping[str, Any]) -> ImportWish:
    return ImportWish(**{**wish.model_dump(), **changes})


def info_of(draft: Draft) -> ImportInfo:
    """Everything that is known."""
    from tracker.io.importing.gathering import file_uses  # with every format

    known, upload = draft.known, draft.upload
    settled, looked = known.settled, known.looked
    uses = file_uses(known.taken, None if settled is None else settled.sources)
    return ImportInfo(
        key=draft.key,
        version=known.version,
        phase=known.phase,
        busy=known.busy,
        under_way=known.waiting or (looked.under_way if looked is not None and known.busy else ""),
        error=on_page(known.error),
        undecided=on_page(known.undecided),
        question=None if known.question is None else _question(known.question, known.wish),
        wish=known.wish,
        received=upload.received if upload.files else draft.size,
        bytes=upload.size if known.phase == "uploading" else draft.size,
        files=_files(uses),
        files_there=sum(one.files.count for one in uses),
        files_used=sum(one.used for one in uses),
        coming=[] if known.taken else upload.names(MOST_LISTED),
        offered=list(places(known.taken))[:MOST_LISTED],
        uploaded=draft.uploaded,
        home=str(draft.home),
        free=shutil.disk_usage(draft.home).free,
        **_recording(settled),
        **_boxes(known),
        told=_notes(settled, looked),
        place=folder_name(known.wish.name),
        open_turns=_open_turns(known),
        cameras=[] if settled is None else [_camera(view, known) for view in settled.views],
        checks=[] if looked is None else [_check(one, known) for one in looked.checks],
        pairs=[] if looked is None else _pairs(looked),
        plan=None if looked is None else _plan(looked, known.wish),
        entrances=[] if looked is None else [_door(one) for one in looked.doors],
        fitting={} if looked is None else dict(looked.fitting),
        unfit={} if looked is None else {key: _unfit(why) for key, why in looked.unfit.items()},
        copied=known.copied,
        megabytes_per_second=_speed(known),
        folder="" if known.folder is None else str(known.folder),
    )


def _recording(settled: ImportPlan | None) -> dict[str, Any]:
    if settled is None:
        return {
            "fps": 0.0, "frames": 0, "unit": "", "up": "", "pose": "", "axes": "", "turns": "",
            "room": None, "suggested": None, "half_extents": None, "suggested_half_extents": None,
            "truth": 0, "has_boxes": False, "found": [],
        }  # fmt: skip
    room, own = settled.room, settled.suggested
    return {
        "fps": settled.fps,
        "frames": settled.frames,
        "unit": settled.reading.unit,
        "pose": settled.reading.direction,
        "axes": settled.reading.axes,
        "turns": _turns(settled),
        "up": settled.reading.up,
        "room": (_vector(room.minimum), _vector(room.maximum)),
        "suggested": (_vector(own.minimum), _vector(own.maximum)),
        "half_extents": _vector(room.half_extents),
        "suggested_half_extents": _vector(own.half_extents),
        "truth": 0 if settled.truth is None else len(np.unique(settled.truth.ids)),
        "has_boxes": all(view.detections is not None for view in settled.views),
        "found": [(what, on_page(how)) for what, how in settled.found],
    }


def _boxes(known: Known) -> dict[str, Any]:
    """How files of boxes are read, as the page's choices name it, where all are read alike."""
    from tracker.io.importing.finding.times import first_index  # with every format

    settled = known.settled
    pieces = [] if settled is None else [view.matched.detections for view in settled.views]
    own = [piece for piece in pieces if piece is not None and len(piece.frames)]
    if settled is None or not own:
        return {"boxes": "", "first_index": ""}
    layouts = {piece.layout or settled.reading.layout for piece in own}
    wished = ImportOptions(first_index=known.wish.first_index)
    # the program that wrote them counts alike: one that begins at 0 speaks for all
    first = min(first_index(piece, wished, settled.frames) for piece in own)
    return {"boxes": layouts.pop() if len(layouts) == 1 else "", "first_index": str(first)}


def _unfit(methods: Mapping[str, str]) -> dict[str, str]:
    return {name: on_page(why) for name, why in methods.items()}


def _notes(settled: ImportPlan | None, looked: Looked | None) -> list[str]:
    """What is said besides the checks: what one of these says as well stands there alone."""
    if settled is None:
        return []
    checks = () if looked is None else looked.checks
    return [on_page(own) for own in unsaid(settled.told, checks)]


def _turns(settled: ImportPlan) -> str:
    by_angles = any(view.matched.raw.turns for view in settled.views)
    return turns_in_words(settled.reading.turns) if by_angles else ""


def _open_turns(known: Known) -> list[tuple[str, str]]:
    pieces = [piece for one in known.taken for piece in one.pieces]
    names = open_turns(
        [raw for piece in pieces if isinstance(piece, CalibrationPiece) for raw in piece.cameras]
    )
    return [(name, product_in_words(name)) for name in names]


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) + 0.0 for value in values)
    return x, y, z


def _files(uses: Sequence[FileUse]) -> list[ImportedFile]:
    # among thousands what is used comes first, then what has a reason
    order = sorted(uses, key=lambda one: (not one.used, not one.files.complaint))
    return [
        ImportedFile(
            label=one.files.label,
            format=one.files.format if one.files.pieces else "",
            read_with=one.files.read_with,
            why=on_page(one.why),
            count=one.files.count,
            used=one.used,
        )
        for one in order[:MOST_LISTED]
    ]


def _camera(view: PlannedView, known: Known) -> ImportedCamera:
    matched, camera = view.matched, view.camera
    settled, looked = known.settled, known.looked
    assert settled is not None
    video, images, boxes = matched.video, matched.images, view.detections
    own = matched.detections
    offsets = () if looked is None else looked.offsets
    return ImportedCamera(
        key=matched.raw.name,
        name=camera.name,
        video=video.path.name if video else images.folder.name if images else "",
        frames=video.frames if video else len(images.files) if images else 0,
        fps=round(view.time.timing.fps or settled.fps, 3),
        width=camera.image_size[0],
        height=camera.image_size[1],
        calibration=_calibration(known, settled, matched.calibration_of),
        calibration_format=settled.calibration,
        calibration_of=matched.calibration_of,
        detections="" if own is None else _label(known, own),
        boxes_format="" if own is None else own.format,
        boxes_per_step=0.0 if boxes is None else round(len(boxes.frames) / settled.frames, 1),
        seconds_late=0.0 - view.time.timing.time_offset,
        offset=next((_offset(one) for one in offsets if one.camera == camera.name), None),
    )


def _calibration(known: Known, settled: ImportPlan, camera: str) -> str:
    """The file that a camera's calibration is in; its format where several make it up."""
    files = [
        (one.label, {raw.name for raw in piece.cameras})
        for one in known.taken
        for piece in one.pieces
        if isinstance(piece, CalibrationPiece) and piece.source in settled.sources
    ]
    labels = {label for label, names in files if camera in names} or {label for label, _ in files}
    return labels.pop() if len(labels) == 1 else settled.calibration


def _label(known: Known, piece: DetectionPiece) -> str:
    """The file or series that a piece is of; of files that are a camera each, this file."""
    for one in known.taken:
        if any(own is piece for own in one.pieces):
            sources = {own.source for own in one.pieces if isinstance(own, DetectionPiece)}
            return one.label if len(sources) == 1 else piece.source.name
    return piece.source.name


def _offset(one: CameraOffset) -> ImportedOffset:
    kept = max(1, -(-len(one.curve.offsets) // MOST_OFFSETS))
    agreement = [
        round(float(value), 4) if math.isfinite(value) else None
        for value in one.curve.agreement[::kept]
    ]
    return filled(
        ImportedOffset,
        one,
        sharpness=one.sharpness if math.isfinite(one.sharpness) else 0.0,
        offsets=[float(value) for value in one.curve.offsets[::kept]],
        agreement=agreement,
    )


def _question(question: Question, wish: ImportWish) -> ImportQuestion:
    wishes = [_changed(wish, mended(wish, own)) for own in question.remedies]
    return filled(
        ImportQuestion,
        question,
        chosen=(on_page(question.flags[0]), on_page(question.flags[1])),
        wishes=(wishes[0], wishes[1]),
    )


def _check(one: Check, known: Known) -> ImportedCheck:
    wish, settled = known.wish, known.settled
    changes = mended(wish, one.remedies)
    views = () if settled is None else settled.views
    return ImportedCheck(
        name=one.name,
        status=one.status,
        sentence=on_page(one.sentence),
        remedy=on_page(" ".join(str(remedy) for remedy in one.remedies)),
        mend=_changed(wish, changes) if changes else None,
        cameras=[view.matched.raw.name for view in views if view.camera.name in one.cameras],
    )


def _pairs(looked: Looked) -> list[ImportedPair]:
    return [
        filled(
            ImportedPair,
            pair,
            pixels=round(pair.pixels, 2) if math.isfinite(pair.pixels) else None,
        )
        for pair in looked.pairs
    ]


def _door(door: Door) -> tuple[Vector, Vector]:
    return _vector(door.position), _vector(door.sigma)


def _speed(known: Known) -> float:
    seconds = time.monotonic() - known.copying_since
    return round(known.copied / 1e6 / seconds, 1) if known.copied and seconds > 0.0 else 0.0


def _plan(looked: Looked, wish: ImportWish) -> ImportedPlan:
    plan = looked.plan
    doors = wish.entrances or [_door(one) for one in looked.doors]
    return ImportedPlan(
        x=plan.origin[0],
        y=plan.origin[1],
        cell=plan.cell,
        width=plan.seen.shape[1],
        height=plan.seen.shape[0],
        seen=plan.seen.ravel().tolist(),
        entrances=[(*place[:2], *sigma[:2]) for place, sigma in doors],
        cameras=list(plan.cameras),
        feet=[(round(float(x), 3), round(float(y), 3)) for x, y in plan.feet],
    )


router = APIRouter(prefix="/api", responses=ERRORS)

JPEG = {"content": {"image/jpeg": {}}, "description": "The picture."}


AtDesk = Annotated[Desk, of_app("desk")]
Opened = Annotated[Recents, of_app("recents")]


def _draft(key: str, desk: AtDesk) -> Draft:
    draft = desk.draft(key)
    if draft is None:
        raise ApiError(
            404,
            "no_import",
            "This import was given up, or the workbench was started anew.",
            hint="Drop the files again.",
        )
    return draft


Own = Annotated[Draft, Depends(_draft)]


@contextmanager
def _complaining() -> Iterator[None]:
    try:
        yield
    except (UploadError, FormatError, ParameterError, OSError) as error:
        raise ApiError(422, "cannot_import", as_sentence(sentence(error))) from None


@router.get("/recordings")
def recordings(recents: Opened, settings: Configured, desk: AtDesk, bench: Bench) -> Recordings:
    """What was open last, the folders of the data folder, the built-in rooms."""
    snapshot = bench.snapshot()
    open_as = [snapshot.opened_as]
    if snapshot.sequence is not None:
        open_as.append(str(snapshot.sequence.folder.absolute()))
    cards = [
        RecordingCard(
            name=one.name, opens=(opens := built_in_name(Path(one.folder)) or one.folder),
            kind="recent", description="", cameras=one.cameras,
            frames=one.frames, fps=one.fps, opened=one.opened,
            picture=f"/api/recordings/picture?recent={number}", open=opens in open_as,
        )
        for number, one in enumerate(recents.all())
    ]  # fmt: skip
    listed = {card.opens for card in cards}
    entries = library.available(settings.data)
    cards += [
        RecordingCard(
            name=entry.name, opens=entry.name, kind=entry.kind, description=entry.description,
            cameras=entry.cameras, frames=entry.frames, fps=0.0, opened=0.0,
            picture=f"/api/recordings/picture?name={quote(entry.name)}",
            open=entry.name in open_as,
        )
        for entry in entries
        if str(entry.folder) not in listed and entry.error is None
    ]  # fmt: skip
    return Recordings(
        recordings=cards,
        folders=desk.folders(),
        data=str(desk.home),
        free=desk.free(),
        most=MOST_BYTES,
    )


@router.get(
    "/recordings/picture",
    response_class=Response,
    responses={200: JPEG, 204: {"description": "It has no pictures."}},
)
def recording_picture(
    recents: Opened,
    settings: Configured,
    name: Annotated[str, Query(max_length=4096, description="Of the list.")] = "",
    recent: Annotated[int, Query(ge=-1, description="Place among the recent ones.")] = -1,
) -> Response:
    """A small picture of a recording of the list."""
    last = recents.all()
    folder = Path(last[recent].folder) if 0 <= recent < len(last) else None
    if folder is None:
        entries = library.available(settings.data)
        folder = next((entry.folder for entry in entries if entry.name == name), None)
    if folder is None:
        raise ApiError(404, "no_recording", "There is no such recording in the list.")
    jpeg = thumbnail(folder)
    if jpeg is None:
        return Response(status_code=204)
    return Response(jpeg, media_type="image/jpeg", headers={"cache-control": "private, no-cache"})


@router.post("/import")
def begin(wish: AnnouncedFiles, desk: AtDesk) -> Begun:
    """Begin an import of files that are sent in pieces."""
    with _complaining():
        draft = desk.begin([Announced(file.path, file.bytes) for file in wish.files])
    return Begun(draft=info_of(draft))


@router.post("/import/path")
def begin_from(wish: PathRequest, desk: AtDesk) -> Begun:
    """Begin an import of a folder on this machine; a recording needs none."""
    with _complaining():
        begun = desk.begin_from(wish.path.strip())
    if isinstance(begun, Path):
        return Begun(draft=None, recording=str(begun))
    return Begun(draft=info_of(begun))


@router.get("/import/{key}")
def show(draft: Own) -> ImportInfo:
    """How far it is, and everything that is known."""
    return info_of(draft)


@router.post("/import/{key}/files")
def add(wish: AnnouncedFiles, draft: Own) -> Begun:
    """More files are to come."""
    with _complaining():
        draft.check_open()
        first = draft.upload.announce([Announced(file.path, file.bytes) for file in wish.files])
        draft.awaits()
    return Begun(draft=info_of(draft), first=first)


@router.put("/import/{key}/files/{number}", status_code=204)
async def receive(
    key: str,
    number: int,
    request: Request,
    draft: Own,
    offset: Annotated[int, Query(ge=0, description="Of the piece's first byte.")] = 0,
) -> None:
    """The next piece of a file."""
    data = await request.body()
    with _complaining():
        draft.upload.receive(number, offset, data)


@router.post("/import/{key}/arrived")
def arrived(draft: Own) -> ImportInfo:
    """All files were sent: look into them."""
    with _complaining():
        upload = draft.upload
        if not upload.complete:
            raise UploadError(
                f"expected {upload.size:,} bytes, {upload.received:,} are here; drop the rest"
            )
        draft.arrived()
    return info_of(draft)


@router.put("/import/{key}/wish")
def wish(told: ImportWish, draft: Own) -> ImportInfo:
    """Have it otherwise."""
    methods = {key: method for key, method in told.methods.items() if method}
    draft.wish(told.model_copy(update={"name": told.name.strip(), "methods": methods}))
    return info_of(draft)


@router.get("/import/{key}/picture", response_class=Response, responses={200: JPEG})
def picture(draft: Own, camera: Annotated[str, Query(max_length=4096)]) -> Response:
    """The middle picture of a camera, by its name in the calibration."""
    jpeg = draft.picture(camera)
    if jpeg is None:
        raise ApiError(404, "no_picture", f"{camera} has no picture.")
    return Response(jpeg, media_type="image/jpeg", headers={"cache-control": "private, no-cache"})


@router.post("/import/{key}/write")
def write(told: WriteRequest, draft: Own, bench: Bench, jobs: Work) -> ImportInfo:
    """Write the recording, and open it; it is tracked with the methods that are wished."""
    methods = {str(key): method for key, method in draft.known.wish.methods.items()}
    with _complaining():
        with_values(RunParameters(), methods)

    def track(done: Future[None]) -> None:
        if not done.cancelled() and done.exception() is None:
            bench.set_parameters(methods, "api")

    def then(folder: Path) -> None:
        if told.open:
            jobs.open(str(folder)).add_done_callback(track)

    with _complaining():
        draft.write(then)
    return info_of(draft)


@router.delete("/import/{key}", status_code=204)
def give_up(key: str, desk: AtDesk) -> None:
    """Give it up; what was uploaded for it is removed."""
    desk.discard(key)

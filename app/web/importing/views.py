"""A draft as the page is told of it."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from app.models.base import Vector
from app.state.importing.draft import Draft, Known, folder_name
from app.state.importing.wish import ImportWish, mended, places
from app.web.importing.models import (
    ImportedCamera,
    ImportedCheck,
    ImportedFile,
    ImportedOffset,
    ImportedPair,
    ImportedPlan,
    ImportInfo,
    ImportQuestion,
)
from app.web.importing.words import on_page
from tracker.io.checks import Check
from tracker.io.checks.synchronisation import CameraOffset
from tracker.io.importing.finding.angles import open_turns, product_in_words, turns_in_words
from tracker.io.importing.gathering import FileUse, file_uses
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.remedies import unsaid
from tracker.io.read.pieces import CalibrationPiece, DetectionPiece

if TYPE_CHECKING:
    from app.state.importing.looking import Looked
    from tracker.geometry.consistency.entrances import Door
    from tracker.io.conventions.questions import Question
    from tracker.io.importing.settling import ImportPlan, PlannedView

MOST_OFFSETS = 241
"""Values of a curve of agreement."""

MOST_LISTED = 200
"""Files that are named one by one."""


def _changed(wish: ImportWish, changes: Mapping[str, Any]) -> ImportWish:
    return ImportWish(**{**wish.model_dump(), **changes})


def info_of(draft: Draft) -> ImportInfo:
    """Everything that is known."""
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
        told=_told(settled, looked),
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


def _told(settled: ImportPlan | None, looked: Looked | None) -> list[str]:
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
    return ImportedOffset(
        steps=one.steps,
        seconds=one.seconds,
        sharpness=one.sharpness if math.isfinite(one.sharpness) else 0.0,
        sure=one.sure,
        offsets=[float(value) for value in one.curve.offsets[::kept]],
        agreement=agreement,
    )


def _question(question: Question, wish: ImportWish) -> ImportQuestion:
    wishes = [_changed(wish, mended(wish, own)) for own in question.remedies]
    return ImportQuestion(
        code=question.code,
        interpretations=question.interpretations,
        difference=question.difference,
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
        ImportedPair(
            first=pair.first,
            second=pair.second,
            share=pair.share,
            pixels=round(pair.pixels, 2) if math.isfinite(pair.pixels) else None,
            odd=pair.odd,
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

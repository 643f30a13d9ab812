"""The routes of opening and importing: what there is, uploads in pieces, wishes, writing."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Depends, Query, Request, Response

from app.errors import ApiError, as_sentence, sentence
from app.state.importing.desk import Desk
from app.state.importing.draft import Draft
from app.state.importing.uploads import MOST_BYTES, Announced, UploadError
from app.state.importing.wish import ImportWish
from app.state.kept.recents import Recents, thumbnail
from app.web.dependencies import ERRORS, Bench, Work
from app.web.importing.models import (
    AnnouncedFiles,
    Begun,
    ImportInfo,
    PathRequest,
    RecordingCard,
    Recordings,
    WriteRequest,
)
from app.web.importing.views import info_of
from tracker.io.read.pieces import FormatError
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, with_values
from tracker.sequences import library
from tracker.sequences.built_in import built_in_name

router = APIRouter(prefix="/api", responses=ERRORS)

JPEG = {"content": {"image/jpeg": {}}, "description": "The picture."}


def _desk(request: Request) -> Desk:
    desk: Desk = request.app.state.desk
    return desk


AtDesk = Annotated[Desk, Depends(_desk)]


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
def recordings(request: Request, desk: AtDesk, bench: Bench) -> Recordings:
    """What was open last, the folders of the data folder, the built-in rooms."""
    recents: Recents = request.app.state.recents
    data: Path | None = request.app.state.settings.data
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
    entries = library.available(data)
    cards += [
        RecordingCard(
            name=entry.name, opens=entry.name, kind=entry.kind, description=entry.description,
            cameras=entry.cameras, frames=entry.frames, fps=0.0, opened=0.0,
            picture=f"/api/recordings/picture?name={quote(entry.name)}",
            open=entry.name in open_as,
        )
        for entry in entries
        if str(entry.folder.absolute()) not in listed and entry.error is None
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
    request: Request,
    name: Annotated[str, Query(max_length=4096, description="Of the list.")] = "",
    recent: Annotated[int, Query(ge=-1, description="Place among the recent ones.")] = -1,
) -> Response:
    """A small picture of a recording of the list."""
    recents: Recents = request.app.state.recents
    last = recents.all()
    folder = Path(last[recent].folder) if 0 <= recent < len(last) else None
    if folder is None:
        entries = library.available(request.app.state.settings.data)
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

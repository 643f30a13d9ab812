"""The HTTP routes by which runs leave: begun, watched, stopped, fetched."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse

from app.errors import ApiError, sentence
from app.messages import Model, RowNumber, VideoPart, filled
from app.state.tasks import Exporter, ExportInfo
from app.web.dependencies import ERRORS, Bench, not_finished, of_app
from app.web.library import Kept
from app.web.results import address_of
from tracker.export.exported_run import ExportedRun, Options
from tracker.export.registry import FORMATS
from tracker.library.keeping import run_for_export, sequence_for_export
from tracker.runs import gaps
from tracker.runs.fitting import default_parameters
from tracker.runs.run import given_names, row_corrections

router = APIRouter(prefix="/api/exports", responses=ERRORS)


class FormatInfo(Model):
    """A form that tracks leave in."""

    name: str
    word: str
    help: str
    video: bool
    """Whether range and speed say how much of it is written."""


class FormatList(Model):
    """All forms."""

    formats: list[FormatInfo]


class ExportRequest(VideoPart, Model):
    """What is wanted."""

    format: str
    run: RowNumber | None = None
    """Its number in the library; null for the one that is shown."""


Out = Annotated[Exporter, of_app("exporter")]


@router.get("/formats")
def formats() -> FormatList:
    """Every form that tracks leave in."""
    return FormatList(
        formats=[filled(FormatInfo, form, video=form.needs_pictures) for form in FORMATS.values()]
    )


@router.get("")
def export(exporter: Out) -> ExportInfo:
    """How far the newest export is."""
    return exporter.now


@router.post("")
def begin(
    request: Request, wish: ExportRequest, exporter: Out, keeper: Kept, bench: Bench
) -> ExportInfo:
    """Begin to write a run, instead of what is under way."""
    if wish.format not in FORMATS:
        raise ApiError(
            422,
            "no_format",
            f"format: expected one of {', '.join(FORMATS)}, got {wish.format!r}",
            field="format",
        )
    form = FORMATS[wish.format]
    options = Options(**wish.model_dump(include=set(VideoPart.model_fields)))
    now, base = bench.snapshot(), str(request.base_url)
    if wish.run is None:
        run, sequence = now.run, now.sequence
        if run is None or sequence is None or run.done == 0:
            raise ApiError(
                409,
                "nothing_computed",
                "There are no tracks yet: nothing has been computed.",
                hint="Wait for the run's first steps, or start it again.",
            )
        done, frames = run.done, run.sequence.frames
        if form.needs_truth and not run.finished:
            raise not_finished("has a report", done, frames)
        rows = slice(0, run.tracks.at(done).start)
        named = now.named(run.sequence)
        written = ExportedRun(
            named,
            run.tracks.take(rows),
            run.parameters,
            run.seed,
            done,
            tuple(gaps.sentences(run)),
            row_corrections(run)[rows],
            given_names(run),
            address_of(base, now.opened_as, run.parameters, now.defaults),
        )
        try:
            form.check(sequence)
        except ValueError as error:
            raise ApiError(422, "cannot_export", sentence(error), field="format") from None
        return exporter.start(form, lambda: written, named.name, options)
    result = keeper.library().result(wish.run)
    recording = keeper.library().recording(result.run.recording)

    def make() -> ExportedRun:
        sequence = sequence_for_export(recording)
        if not sequence.views:
            return run_for_export(sequence, result)
        back = address_of(base, result.place, result.parameters, default_parameters(sequence))
        return run_for_export(sequence, result, back)

    name = f"{result.run.recording_name}-{result.run.name or result.run.id}"
    return exporter.start(form, make, name, options)


@router.delete("")
def stop(exporter: Out) -> ExportInfo:
    """Stop the export under way; nothing of it is left."""
    exporter.cancel()
    return exporter.now


MEDIA: dict[str, dict[str, str]] = {form.media: {} for form in FORMATS.values()}


@router.get(
    "/file",
    response_class=FileResponse,
    responses={200: {"content": MEDIA, "description": "The file."}},
)
def file(exporter: Out) -> FileResponse:
    """What the newest export wrote."""
    path = exporter.file
    if path is None:
        raise ApiError(409, "nothing_written", "No export is finished.", hint="Begin one first.")
    media = FORMATS[exporter.now.format].media
    return FileResponse(path, media_type=media, filename=path.name)

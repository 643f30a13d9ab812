"""The routes of what is open and how it is looked at; ``/docs`` shows them with their types."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Response

from app.errors import ApiError
from app.messages import Model, filled
from app.state.sensitivity import Sensitivity, shares
from app.state.snapshot import RunPhase, Snapshot
from app.web import results, steps
from app.web.dependencies import (
    ERRORS,
    FOR_EVER,
    Bench,
    Configured,
    Owned,
    Part,
    Work,
    a_file,
    begun,
    download,
    file_name,
    of_app,
    opened,
    told_in_the_answer,
)
from app.web.pictures import Pictures
from app.web.results import Schema, SequenceEntryInfo, SequenceList, State
from app.web.steps import Step
from app.web.stream import (
    CurveRequest,
    LayerChanges,
    OpenRequest,
    SeekChange,
    SelectChange,
    ThemeChange,
    TrailChanges,
    ViewChange,
)
from app.web.timeline import Timeline, Timelines
from tracker.export import tracks_csv
from tracker.parameters.values import changed_values, value_of
from tracker.runs import gaps
from tracker.runs.run import given_names, row_corrections
from tracker.sequences import library
from tracker.sequences.sequence import Sequence


class ChangedValue(Model):
    """A parameter or method that is not at its default."""

    key: str
    default: Any
    now: Any


class CurveInfo(Model):
    """What a parameter would change, as far as it is computed."""

    key: str
    measure: str
    """MOTA; where there is no truth the number of tracks."""
    values: list[Any]
    """Ascending, or the choices."""
    scores: list[float | None]
    """One a value; null where the run failed."""
    whole: bool
    """Whether there is nothing more to come."""
    share: float | None
    """Share of the variance of the measure that the parameter explains alone, among those whose
    curves are whole, as studies report it; null where there are not two of them."""


class Changes(Model):
    """What differs from the defaults, and what parameters would change."""

    changed: list[ChangedValue]
    curves: list[CurveInfo]
    """The curves of the parameters that somebody asked for."""


class PastRunInfo(Model):
    """One run, finished or not."""

    number: int
    """From 1 on."""
    key: str
    at: str
    """Time of day at which it began, as text."""
    sequence: str
    """The sequence's name at that time."""
    same_recording: bool
    """Whether it is of the recording that is open, so that its parameters can be used again."""
    single_view: str
    fusion_method: str
    state: RunPhase
    done: int
    total: int
    steps_per_second: float
    changes: int
    """How many parameters were not at their defaults."""


class PastRuns(Model):
    """The runs since the server was started, newest first."""

    runs: list[PastRunInfo]


router = APIRouter(prefix="/api", responses=ERRORS)

Effects = Annotated[Sensitivity, of_app("sensitivity")]

MOST_STEPS = 64
"""Steps that one request may ask for."""


@router.get("/state")
async def state(bench: Bench) -> State:
    """Everything that all pages share, but for the results themselves."""
    return results.state_of(bench.snapshot())


@router.get("/schema")
async def schema() -> Schema:
    """Every parameter with range, unit and help; the methods; the presets."""
    return results.schema()


@router.get("/sequences")
def sequences(settings: Configured) -> SequenceList:
    """The built-in rooms and the folders under the data folder."""
    return SequenceList(
        sequences=[
            filled(SequenceEntryInfo, entry, folder=str(entry.folder))
            for entry in library.available(settings.data)
        ]
    )


@router.post("/sequence")
async def open_sequence(wish: OpenRequest, bench: Bench, jobs: Work) -> State:
    """Open another sequence, in the background where it takes longer; ``opening`` says so."""
    with told_in_the_answer(
        wish.name,
        field="name",
        hint="What was open still is; Open lists what there is.",
    ):
        await begun(jobs.open(wish.name))
    return results.state_of(bench.snapshot())


@router.post("/run/cancel")
async def cancel_run(bench: Bench, jobs: Work) -> State:
    """Stop the run under way; its steps so far stay."""
    jobs.cancel()
    return results.state_of(bench.snapshot())


@router.post("/run")
async def run_again(bench: Bench, jobs: Work) -> State:
    """Go on with a run that was cancelled, or try a failed one again."""
    jobs.run_again()
    return results.state_of(bench.snapshot())


@router.get("/runs")
def past_runs(owners: Owned, bench: Bench) -> PastRuns:
    """The current run and those before it since the server was started."""
    now = bench.snapshot()
    name = now.sequence.name if now.sequence is not None else ""
    return PastRuns(
        runs=[
            filled(
                PastRunInfo,
                run,
                key=run.state.key,
                same_recording=run.sequence == name or run.recording == now.sequence_key,
                single_view=run.parameters.single_view,
                fusion_method=run.parameters.fusion_method,
                state=run.state.state,
                done=run.state.done,
                total=run.state.total,
                steps_per_second=run.state.steps_per_second,
            )
            for run in owners.history.runs
        ]
    )


@router.get("/changes")
def changes(sensitivity: Effects, bench: Bench) -> Changes:
    """What differs from the defaults, and what parameters would change."""
    snapshot = bench.snapshot()
    curves = sensitivity.curves()
    explained = shares(curves)
    return Changes(
        changed=[
            ChangedValue(key=key, default=value_of(snapshot.defaults, key), now=value)
            for key, value in changed_values(snapshot.parameters, snapshot.defaults).items()
        ],
        curves=[
            filled(CurveInfo, curve, share=explained.get(key)) for key, curve in curves.items()
        ],
    )


@router.post("/sensitivity")
async def compute_curves(sensitivity: Effects, wish: CurveRequest, bench: Bench) -> State:
    """Compute in the background what some parameters would change, until somebody works.

    ``GET /api/changes`` has it, and the tasks of the state how far it is: ``effects``.
    """
    sensitivity.ask(wish.keys)
    return results.state_of(bench.snapshot())


@router.post("/seek")
async def seek(wish: SeekChange, bench: Bench) -> State:
    """Move the playhead, as far as the sequence goes."""
    bench.seek(wish.step, wish.origin)
    return results.state_of(bench.snapshot())


@router.post("/select")
async def select(wish: SelectChange, bench: Bench) -> State:
    """Select a track, or none."""
    bench.select(wish.id)
    return results.state_of(bench.snapshot())


@router.patch("/layers")
async def set_layers(wish: LayerChanges, bench: Bench) -> State:
    """Switch layers of the 3D view."""
    bench.set_layers(wish.changes)
    return results.state_of(bench.snapshot())


@router.patch("/trail")
async def set_trail(wish: TrailChanges, bench: Bench) -> State:
    """Draw trails longer or shorter, fading or not."""
    bench.set_trail(wish.seconds, wish.fades)
    return results.state_of(bench.snapshot())


@router.post("/view")
async def view(wish: ViewChange, bench: Bench) -> State:
    """Look through a camera in 3D, from above, or freely again."""
    bench.look(wish.camera)
    return results.state_of(bench.snapshot())


@router.post("/theme")
async def theme(wish: ThemeChange, bench: Bench) -> State:
    """Have the 3D view dark or light, as the page is."""
    bench.set_theme(wish.theme)
    return results.state_of(bench.snapshot())


@router.get("/picture/{sequence_key}/{camera}/{step}.jpg", **a_file("image/jpeg", "The picture."))
async def picture(
    pictures: Annotated[Pictures, of_app("pictures")],
    sequence_key: str,
    camera: int,
    step: int,
    w: Annotated[int | None, Query(ge=16, le=8192, description="A smaller width.")] = None,
    nearest: Annotated[bool, Query(description="Else that of the nearest step.")] = False,
) -> Response:
    """One camera's picture of one step; ``X-Step`` says which one it is of."""
    found = await pictures.nearest(sequence_key, camera, step) if nearest else step
    jpeg = await pictures.get(sequence_key, camera, found, w)
    headers = {"cache-control": FOR_EVER, "x-step": str(found)}
    return Response(jpeg, media_type="image/jpeg", headers=headers)


@dataclass(frozen=True)
class StepDetails:
    """What of a step is told besides what is always told."""

    samples: Annotated[bool, Query(description="With samples and what was dropped.")] = False
    trails: Annotated[bool, Query(description="With the tracks' ways in the pictures.")] = False
    seconds: Annotated[float, Query(ge=0.5, le=600.0, description="How far back.")] = 4.0

    def of(self, snapshot: Snapshot, sequence: Sequence, step: int) -> Step:
        """The message of one step.

        Raises:
            ApiError: If the sequence has no such step.
        """
        if not 0 <= step < sequence.frames:
            raise ApiError(
                404,
                "no_step",
                f"There is no step {step}: {sequence.name} has 0 … {sequence.frames - 1}.",
                field="step",
            )
        trails = self.seconds if self.trails else 0.0
        return steps.step_of(sequence, snapshot.run, step, with_samples=self.samples, trails=trails)


Details = Annotated[StepDetails, Depends()]


@router.get("/step/{step}")
async def step(step: int, bench: Bench, details: Details) -> Step:
    """One step of the shown run: what each camera found, the targets, the truth."""
    return details.of(*opened(bench), step)


@router.get("/steps")
def several_steps(
    step: Annotated[list[int], Query(max_length=MOST_STEPS, description="Once for each step.")],
    bench: Bench,
    details: Details,
) -> list[Step]:
    """Several steps of the shown run at once, as ``/api/step/{step}`` has each."""
    snapshot, sequence = opened(bench)
    return [details.of(snapshot, sequence, one) for one in step]


@router.get("/timeline")
def timeline(made: Annotated[Timelines, of_app("timelines")], bench: Bench, part: Part) -> Timeline:
    """The shown run over time, as far as it is computed, at the width that it is drawn at."""
    snapshot, sequence = opened(bench)
    return made.of(sequence, snapshot.run, part.window(sequence.frames), snapshot.scores.pinned)


@router.get("/export/tracks.csv", **a_file("text/csv", "The track file."))
def export_tracks(bench: Bench) -> Response:
    """The tracks of the shown run; ``X-Run-Partial`` says whether steps are missing, or these are
    still the tracks before smoothing."""
    snapshot = bench.snapshot()
    run = snapshot.run
    if run is None or run.done == 0:
        raise ApiError(
            409,
            "nothing_computed",
            "There are no tracks yet: nothing has been computed.",
            hint="Wait for the run's first steps, or start it again.",
        )
    finished, done, tracks = run.finished, run.done, run.tracks
    sequence = snapshot.named(run.sequence)
    name = file_name(sequence.name, "tracks.csv")
    stream = io.StringIO(newline="")
    remarks = list(gaps.sentences(run))
    if done == run.sequence.frames and not finished:
        remarks.append("these are the filter's tracks, since the smoothing is not finished")
    tracks_csv.write_tracks_csv(
        stream,
        sequence,
        tracks,
        run.parameters,
        run.seed,
        done=done,
        remarks=remarks,
        row_corrections=row_corrections(run),
        names=given_names(run),
    )
    return download(
        stream.getvalue(),
        name,
        "text/csv; charset=utf-8",
        x_run_key=run.key,
        x_run_partial="false" if finished else "true",
        x_run_steps=f"{done}/{run.sequence.frames}",
    )

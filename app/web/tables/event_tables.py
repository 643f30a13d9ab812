"""What happens to the tracks, and how sure that is, as parts of the page."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from app.models import LaneEvent
from app.state.snapshot import Snapshot
from app.state.workers.identity_check import Checked, IdentityCheck
from app.web.dependencies import ERRORS, Bench, nothing_open
from app.web.evaluation import messages
from app.web.tables.markup import (
    blank,
    button,
    id_tag,
    joined,
    line,
    number,
    quiet,
    table,
)
from app.web.views.decisions import words_of
from app.web.views.timeline import Timelines
from tracker.review.self_consistency import Estimate
from tracker.review.self_consistency.estimate import WARNING

MOST_EVENTS = 500
"""Rows of the table of events; more are counted."""

LOW_OVERLAP = 0.3
"""Below this mean overlap of a camera's boxes with the others' people a figure means little:
the cameras do not speak of the same people."""

Kind = Literal["birth", "death", "switch", "long miss", "cut", "joined", "removed", "doubt"]

router = APIRouter(prefix="/api/tables", responses=ERRORS, default_response_class=HTMLResponse)


@router.get("/events")
def event_table(
    request: Request,
    bench: Bench,
    kind: Annotated[Kind | None, Query(description="Only these.")] = None,
) -> str:
    """Births, deaths, switches, long misses, what smoothing changed, and what is doubtful where
    somebody had identities checked; each can be gone to."""
    snapshot = bench.snapshot()
    sequence, run = snapshot.sequence, snapshot.run
    if sequence is None:
        raise nothing_open()
    timelines: Timelines = request.app.state.timelines
    found: list[LaneEvent | tuple[int, int, Kind]] = (
        [] if run is None else list(timelines.events(sequence, run))
    )
    scored = snapshot.scores.shown
    if run is not None and scored is not None and scored.is_of(run) and scored.evaluation:
        found += [(s.step, s.track, "switch") for s in messages.switches_of(scored.evaluation)]
    check: IdentityCheck = request.app.state.identity_check
    if kind == "doubt":
        return _doubts(check.now, snapshot)
    why = {} if run is None else dict[tuple[int, int, str], str](words_of(run))
    estimated = _found(check.now, snapshot)
    for doubt in () if estimated is None else estimated.disagreements:
        found.append((doubt.step, doubt.ids[0], "doubt"))
        why[doubt.step, doubt.ids[0], "doubt"] = f"doubtful: {doubt.why}"
    found = sorted((event for event in found if kind in (None, event[2])), key=lambda e: e[:2])
    if not found:
        return blank(
            "No such event",
            "Births, deaths, switches of identity and long misses are listed as they are found.",
        )
    more = len(found) - MOST_EVENTS
    return table(
        "Events",
        ("#Step", "#Time  s", "Event", "Track"),
        [
            (
                button(step, "go", f"{step} {track}", label=f"Go to step {step}"),
                number(step / sequence.fps, 2),
                why.get((step, track, what), what),
                id_tag(track),
            )
            for step, track, what in found[:MOST_EVENTS]
        ],
    ) + (line(f"and {more} more") if more > 0 else "")


def checked(request: Request, snapshot: Snapshot) -> str:
    """How well people are told apart, as far as the recording alone can say."""
    check: IdentityCheck = request.app.state.identity_check
    return _checked(check.now, snapshot)


def _found(now: Checked, snapshot: Snapshot) -> Estimate | None:
    """What is known of the shown run."""
    return now.found if snapshot.run is not None and now.run == snapshot.run.key else None


def _checked(now: Checked, snapshot: Snapshot) -> str:
    """The estimate with what it rests on; else how to have it."""
    sequence, found = snapshot.sequence, _found(now, snapshot)
    if sequence is None:
        return ""
    if now.state == "looking":
        share = f"{100 * now.done / now.total:.0f} %" if now.total else "beginning"
        return line(
            "Looking backwards in time and without each camera: ",
            f"{share} ",
            button("Stop", "checkIdentities", "stop"),
        )
    again = button("Check identities", "checkIdentities", "start")
    if found is None:
        failed = now.state == "failed" and snapshot.run is not None and now.run == snapshot.run.key
        why = f"{now.error} " if failed else ""
        return line(
            f"{why}Without truth: are people still the same backwards in time and without each "
            "camera? It takes about as long as one run for each of these. ",
            again,
        )
    low, high = found.interval
    rows = [
        (
            "IDF1, estimated",
            number(found.score, 3),
            f"{low:.3f} … {high:.3f} in nine of ten runs by which it was calibrated",
        ),
        ("backwards in time", number(found.backwards, 3), "IDF1 by the run as it is"),
    ]
    for camera, agreed, overlap in zip(
        sequence.cameras, found.without, found.overlaps, strict=False
    ):
        words = f"its boxes overlap the others’ people by {number(overlap, 2)}"
        if overlap is not None and overlap < LOW_OVERLAP:
            words += ": they speak of other people, trust nothing here"
        rows.append((f"without {camera.name}", number(agreed, 3), words))
    return table("Identity without truth", ("Without truth", "#IDF1", "Which is"), rows) + line(
        quiet(WARNING)
    )


def _doubts(now: Checked, snapshot: Snapshot) -> str:
    found = _found(now, snapshot)
    sequence = snapshot.sequence
    if found is None or sequence is None:
        return _checked(now, snapshot)
    low, high = found.interval
    head = line(
        f"IDF1 is estimated {number(found.score, 3)} ({low:.3f} … {high:.3f}); ",
        "Compare tells by what. ",
        quiet(WARNING),
    )
    if not found.disagreements:
        return head + line("All ways to look agree: no moment is doubtful.")
    return head + table(
        "Doubtful moments",
        ("#Step", "#Time  s", "Doubtful, the most doubtful first", "Tracks"),
        [
            (
                button(
                    doubt.step,
                    "go",
                    f"{doubt.step} {doubt.ids[0]}",
                    label=f"Go to step {doubt.step}",
                ),
                number(doubt.step / sequence.fps, 2),
                doubt.why,
                joined(*(id_tag(name) for name in doubt.ids)),
            )
            for doubt in found.disagreements[:MOST_EVENTS]
        ],
    )

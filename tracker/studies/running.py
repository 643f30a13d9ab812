"""The run of a study: trials are asked for, their runs computed, and their results stored.

Every result is on disk before the sampler gets it, so that the process may be killed at any time:
the next start continues the trials that were active, with the runs that ended from disk.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

from tracker.studies.defined.definition import Definition
from tracker.studies.defined.space import defaults_of
from tracker.studies.errors import StudyError
from tracker.studies.found.importance import Weighing
from tracker.studies.found.proposing import SEARCH_SHARE, Proposer
from tracker.studies.judging import Judge
from tracker.studies.kept.records import JobRow, Status, Trial
from tracker.studies.kept.store import JOURNAL, Store
from tracker.studies.kept.writer import Writer
from tracker.studies.opened import Recordings, check_same, open_recordings
from tracker.studies.sampling import Sampler, first_values
from tracker.studies.turn import turn
from tracker.studies.work.cluster import Crew, WorkerState
from tracker.studies.work.jobs import Job, Outcome

SECONDS_BETWEEN = 0.5
"""Interval at which the status is written and a request to stop is checked, seconds."""

AHEAD = 1
"""The number of queued runs for each active one, so that no worker waits for the sampler."""


def run_study(
    store: Store,
    writer: Writer,
    crew: Callable[[Callable[[str], None]], Crew],
    *,
    on_status: Callable[[Status], None] = lambda status: None,
    stopped: Callable[[], bool] = lambda: False,
    beside: bool = False,
) -> Status:
    """Run a study to its end, or resume it.

    Args:
        store: The folder of the study.
        writer: The writer from :meth:`~tracker.studies.kept.store.Store.running`.
        crew: A function that starts the workers; it gets a callback for sentences on what is being
            done.
        on_status: A callback that gets the status at intervals.
        stopped: A callback that is asked at the same intervals whether to stop.
        beside: Whether the study runs beside others, since its workers are on other machines;
            otherwise it waits until no other study runs on this machine.

    Returns:
        The status at the end: ``done``, or ``stopped`` if that was requested.

    Raises:
        StudyError: If the study cannot continue; the status has the same sentence.
    """
    study = _Running(store, writer, on_status, stopped)
    try:
        study.prepare()
        with nullcontext(True) if beside else turn(store.name, study.waits) as mine:
            if mine:
                study.crew = crew(study.wait_for)
                study.work()
            else:
                study.end_early()
            study.say()
    except StudyError as error:
        study.state, study.words = "failed", str(error)
        study.say()
        raise
    except BaseException:
        study.state, study.words = "stopped", "interrupted; nothing that ended before is lost"
        study.say()
        raise
    finally:
        study.close()
    return study.status


class _Running:
    """One session of a study."""

    crew: Crew

    def __init__(
        self,
        store: Store,
        writer: Writer,
        on_status: Callable[[Status], None],
        stopped: Callable[[], bool],
    ) -> None:
        self._store, self._writer = store, writer
        self._on_status, self._stopped = on_status, stopped
        self._definition: Definition = store.definition()
        self._active: dict[int, Active] = {}
        self._waiting: dict[str, list[Active]] = {}
        self._queue: list[dict[str, Any]] = []
        self._begin = time.monotonic()
        self._spent = float(store.fact("spent") or 0.0)
        self._pace = Pace()
        self._last_status = 0.0
        self._slots = 1
        self.state: Any = "running"
        self.words = ""
        self.status = Status("running")

    def prepare(self) -> None:
        """Open the recordings and the sampler, and load earlier results."""
        self.wait_for("opening the recordings")
        definition = self._definition
        self._recordings: Recordings = open_recordings(definition, self.wait_for)
        check_same(self._store, self._writer, self._recordings)
        ended = self._store.trials()
        self._judge = Judge(self._recordings.objectives, ended, self._writer.outcome)
        self._ended = {trial.number for trial in ended}
        self._sampler = Sampler(
            self._store.folder / JOURNAL,
            definition,
            self._recordings.objectives,
            self._recordings.bases,
        )
        self._asked = self._sampler.asked
        by_number = {trial.number: trial for trial in ended}
        for number in self._sampler.open_trials():
            values = self._sampler.again(number)
            if number in by_number:  # its result was stored but not reported to the sampler
                self._sampler_hears(by_number[number])
            else:
                self._take_up(number, values)
        defaults = defaults_of(definition.varied, self._recordings.bases[0])
        first = first_values(definition, defaults)
        self._fixed = len(first)
        grid = self._sampler.grid() if definition.search == "grid" else None
        self._trials = definition.trials if grid is None else len(first) + len(grid)
        self._queue = [*first, *(grid or [])][self._asked :]
        self._weighing = Weighing(definition.varied, defaults)

    def close(self) -> None:
        """Close the sampler's files."""
        if hasattr(self, "_sampler"):
            self._sampler.close()

    # the loop

    def work(self) -> None:
        """Run trials until all have ended, the time is over, or the study is stopped."""
        self._slots = self.crew.slots
        self.words = ""
        self._begin = time.monotonic()
        for active in list(self._active.values()):
            self._send(active)
        while not self._is_stopped():
            self._fill()
            if not self._active:
                words = self._why_done()
                self._weigh(last=True)
                if self._definition.propose and not self._propose():
                    break
                self.state, self.words = "done", words
                return
            self._receive(self.crew.finished(SECONDS_BETWEEN))
            self._now_and_then()
        self.end_early()

    def end_early(self) -> None:
        """Set the state to ``stopped``."""
        self.state = "stopped"
        self.words = "stopped; nothing that ended before is lost"

    def _fill(self) -> None:
        """Ask for trials until enough runs are queued for all workers."""
        while len(self._waiting) < self._slots * (1 + AHEAD) and self._may_ask():
            values = self._queue.pop(0) if self._queue else None
            number, drawn = self._sampler.ask(values)
            self._asked = number + 1
            if number < self._fixed and values is not None:
                drawn = values if number == 0 else drawn | values
            active = self._take_up(number, drawn)
            self._send(active)
            if active.is_back:  # all its runs were computed for other trials
                self._receive()

    def _may_ask(self) -> bool:
        if self._asked >= self._trials or self._stopped():
            return False
        return self._asked < 1 or self._minutes_left() > 0.0

    def _minutes_left(self, share: float | None = None) -> float:
        if self._definition.minutes is None:
            return float("inf")
        if share is None:
            share = SEARCH_SHARE if self._definition.propose else 1.0
        return share * self._definition.minutes - (self._spent + self._seconds()) / 60.0

    def _seconds(self) -> float:
        return time.monotonic() - self._begin

    def _take_up(self, number: int, values: dict[str, Any]) -> Active:
        if number == 0:
            values = defaults_of(self._definition.varied, self._recordings.bases[0])
        # the first trial has the defaults of each recording
        jobs = self._recordings.jobs({} if number == 0 else values)
        active = self._active[number] = Active(number, values, jobs)
        return active

    def _send(self, active: Active) -> None:
        """Submit the next runs of a trial; outcomes that are stored already are taken at once."""
        first = self._judge.first_runs(len(active.jobs), self._definition.prune)
        upto = first if active.sent == 0 else len(active.jobs)
        for _, job in active.jobs[active.sent : upto]:
            kept = self._writer.outcome(job.key)
            if kept is not None and kept.became == "done":
                active.outcomes[job.key] = kept
            elif job.key in self._waiting:
                self._waiting[job.key].append(active)
            else:
                self._waiting[job.key] = [active]
                self.crew.submit(job, -active.number)
        active.sent = upto
        active.wanted = len({row.key for row, _ in active.jobs[:upto]})

    def _propose(self) -> bool:
        """Measure the best trials again and store the proposal; False if the study was stopped."""
        if self._store.fact("tuned") is not None:
            return True
        definition = self._definition
        first = max(definition.seeds) + 1
        proposer = Proposer(
            self._recordings,
            self._store.trials(),
            defaults_of(definition.varied, self._recordings.bases[0]),
            definition.start if self._fixed > 1 else {},
            range(first, first + definition.propose),
            self._measure,
        )
        self.words = "measuring the best again on other seeds"
        found = proposer.propose()
        if self._is_stopped():
            return False
        self._writer.put_fact("tuned", found)
        return True

    def _measure(self, jobs: Sequence[Job]) -> dict[str, Outcome]:
        """Have jobs done that belong to no trial, as far as the time allows."""
        found: dict[str, Outcome] = {}
        wanted = {job.key: job for job in jobs}
        for key, job in wanted.items():
            if (kept := self._writer.outcome(key)) is not None:
                found[key] = kept
            elif self._minutes_left(1.0) > 0.0:
                self._waiting[key] = []
                self.crew.submit(job)
        while self._waiting and not self._is_stopped():
            for outcome in self.crew.finished(SECONDS_BETWEEN):
                self._came(outcome)
                found[outcome.key] = outcome
            if time.monotonic() - self._last_status >= SECONDS_BETWEEN:
                self.say()
        return found

    def _is_stopped(self) -> bool:
        return self._stopped() or self._store.asked_to_stop()

    def _came(self, outcome: Outcome) -> None:
        if outcome.became == "done":
            self._writer.keep(outcome)
        self._pace.came(outcome.seconds)
        for active in self._waiting.pop(outcome.key, ()):
            active.outcomes[outcome.key] = outcome

    def _receive(self, outcomes: Sequence[Outcome] = ()) -> None:
        """Store outcomes, and end the trials whose runs have all ended.

        Everything is on disk before the sampler gets it.
        """
        ended = []
        with self._writer.together():
            for outcome in outcomes:
                self._came(outcome)
            for number in sorted(self._active):
                if (trial := self._continued(self._active[number])) is not None:
                    ended.append(trial)
        for trial in ended:
            self._sampler_hears(trial)

    def _continued(self, active: Active) -> Trial | None:
        """Submit the next runs of a trial, or end it.

        Returns:
            The trial if it ended; None otherwise. No trial ends before that of the defaults, by
            which it is judged.
        """
        while active.is_back:
            failed = next((o for o in active.outcomes.values() if o.became != "done"), None)
            if failed is not None and active.number == 0:
                raise StudyError(
                    f"the defaults cannot be run, so that nothing can be set against them: "
                    f"{failed.words}"
                )
            if active.number != 0 and 0 not in self._ended:
                return None
            if failed is None and active.sent < len(active.jobs):
                rows = [row for row, _ in active.jobs[: active.sent]]
                hopeless = self._judge.is_hopeless(rows, active.outcomes)
                if not hopeless or active.number < self._fixed:
                    self._send(active)
                    continue
            return self._end(active, failed)
        return None

    def _end(self, active: Active, failed: Outcome | None) -> Trial:
        rows = tuple(row for row, _ in active.jobs[: active.sent])
        words = "the defaults" if active.number == 0 else ""
        if active.number == 1 and self._fixed > 1:
            words = "where you were"
        trial = self._judge.trial(
            active.number,
            active.values,
            rows,
            active.outcomes,
            pruned=active.sent < len(active.jobs),
            words=failed.words if failed is not None else words,
            failed=failed is not None,
        )
        self._writer.end(trial)
        self._ended.add(trial.number)
        del self._active[active.number]
        return trial

    def _sampler_hears(self, trial: Trial) -> None:
        values = None if trial.state == "failed" else self._judge.for_sampler(trial)
        self._sampler.tell(trial.number, values, pruned=trial.state == "pruned")

    # the status

    def wait_for(self, words: str) -> None:
        """Write a status that says what is being waited for."""
        self.words = words
        self.say()

    def waits(self, words: str) -> bool:
        """Write what is being waited for, and restart the clock; False if the study is stopped."""
        self._begin = time.monotonic()
        self.wait_for(words)
        return not self._is_stopped()

    def _now_and_then(self) -> None:
        if time.monotonic() - self._last_status >= SECONDS_BETWEEN:
            self._slots = self.crew.slots
            self.words = "" if self.crew.workers() else "waits for a worker"
            self._weigh()
            self.say()

    def say(self) -> None:
        """Write the current status."""
        seconds = self._seconds()
        done = len(getattr(self, "_ended", ()))
        at_it = self.state == "running" and hasattr(self, "crew")
        self.status = Status(
            self.state,
            self.words,
            done=done,
            trials=getattr(self, "_trials", self._definition.trials),
            runs=self._pace.runs,
            seconds=seconds,
            seconds_left=self._seconds_left(done),
            busy=self._pace.busy(self._slots),
            workers=at_work(self.crew.workers(), self._waiting) if at_it else [],
            all_runs=self._writer.runs,
            all_seconds=self._spent + seconds,
            process=os.getpid(),
            written=time.time(),
        )
        self._writer.write_status(self.status)
        if hasattr(self, "_trials"):
            self._writer.put_fact("spent", self._spent + seconds)
        self._on_status(self.status)
        self._last_status = time.monotonic()

    def _seconds_left(self, done: int) -> float | None:
        if self.state != "running" or not hasattr(self, "_trials"):
            return None
        left = self._pace.seconds_left(done, self._trials)
        return None if left is None else max(0.0, min(left, 60.0 * self._minutes_left()))

    def _why_done(self) -> str:
        if len(self._ended) >= self._trials:
            return ""
        if self._definition.minutes is None:
            return "some of its trials are not among the results any more"
        return f"the {self._definition.minutes:g} minutes are over"

    def _weigh(self, *, last: bool = False) -> None:
        """Store the importance of the parameters if there is a new estimate."""
        found = self._weighing.news(
            self._judge.complete, self.crew, worked=self._pace.worked, last=last
        )
        if found is not None:
            self._writer.put_fact("importance", found)


@dataclass(eq=False)
class Active:
    """A trial whose runs are being computed."""

    number: int
    values: dict[str, Any]
    jobs: list[tuple[JobRow, Job]]
    sent: int = 0
    """The number of jobs that were submitted."""
    wanted: int = 0
    """The number of different runs among these."""
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    """The outcomes of the runs that ended, by key."""

    @property
    def is_back(self) -> bool:
        """Whether all runs that were submitted have ended."""
        return len(self.outcomes) >= self.wanted


def at_work(
    workers: Iterable[WorkerState], waiting: Mapping[str, Sequence[Active]]
) -> list[dict[str, Any]]:
    """Return for each worker what it does, as plain values.

    Args:
        workers: The states of the workers.
        waiting: The trials that wait for each run, by the key of its job.
    """
    found = []
    for one in workers:
        task: dict[str, Any] = {"trial": None, "recording": None, "seed": None}
        for active in waiting.get(one.job or "", ())[:1]:
            row = next(row for row, _ in active.jobs if row.key == one.job)
            task = {"trial": active.number, "recording": row.recording, "seed": row.seed}
        words = one.words or ("" if task["trial"] is not None else "waits for a run")
        found.append(
            {"name": one.name, "machine": one.machine, "words": words, "since": one.since} | task
        )
    return found


class Pace:
    """The speed of a study in one session."""

    def __init__(self) -> None:
        self.runs = 0
        """The number of runs that ended."""
        self.worked = 0.0
        """The time that workers spent on them, seconds."""
        self._warm: float | None = None
        self._since_warm = 0.0
        self._first: tuple[float, int] | None = None

    def came(self, seconds: float) -> None:
        """Count a run that ended after so many seconds of a worker's time."""
        self.runs += 1
        self.worked += seconds
        if self._warm is None:
            self._warm = time.monotonic()
        else:
            self._since_warm += seconds

    def busy(self, slots: int) -> float | None:
        """Return the share of the workers' time in which they worked, since the first run ended;
        None before there are two runs for each worker."""
        if self._warm is None or self.runs < 2 * slots:
            return None
        elapsed = time.monotonic() - self._warm
        return min(1.0, self._since_warm / (elapsed * slots)) if elapsed > 0.0 else None

    def seconds_left(self, done: int, trials: int) -> float | None:
        """Estimate the remaining time from the mean time of a trial, seconds; None before two
        trials ended."""
        if self._first is None:
            self._first = time.monotonic(), done
        begin, before = self._first
        if done - before < 2:
            return None
        return (trials - done) * (time.monotonic() - begin) / (done - before)

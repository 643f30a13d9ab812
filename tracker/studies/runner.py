"""The run of a study: the sampler draws trials, workers compute their runs, results are stored.

Every trial is on disk before its runs begin, and every result before it is reported to the sampler,
so that the process may be killed at any time: the next start continues the trials under way, and
reads the runs that ended from disk.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tracker.studies.cluster import Crew, WorkerState
from tracker.studies.definition import StudyDefinition
from tracker.studies.errors import StudyError
from tracker.studies.importance import ImportanceEstimator
from tracker.studies.jobs import Job, Outcome
from tracker.studies.judging import Judge
from tracker.studies.proposal import SEARCH_SHARE, Proposer
from tracker.studies.recordings import Recordings, check_same, open_recordings
from tracker.studies.sampling import Sampler
from tracker.studies.store import JobRow, Status, Store, Trial, Writer, turn

SECONDS_BETWEEN = 0.5
"""Interval at which the status is written and a request to stop is checked, seconds."""

AHEAD = 1
"""The number of queued runs for each run that is being computed, so that no worker waits for the
sampler."""


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
        writer: The writer from :meth:`~tracker.studies.store.Store.running`.
        crew: A function that starts the workers; its argument is a callback that gets sentences on
            the progress.
        on_status: A callback that gets the status at intervals.
        stopped: A callback that returns whether to stop; it is called at the same intervals.
        beside: Whether the study does not wait until no other study runs on this machine, since its
            workers are on other machines.

    Returns:
        The status at the end: ``done``, or ``stopped`` if that was requested.

    Raises:
        StudyError: If the study cannot continue; the status has the same message.
    """
    report = _Report(store, writer, on_status)

    def waits(words: str) -> bool:
        report.restart(words)
        return not (stopped() or store.asked_to_stop())

    with ExitStack() as held:
        try:
            opened = _open(store, writer, report)
            mine = held.enter_context(nullcontext(True) if beside else turn(store.name, waits))
            if mine:
                at_work = crew(report.wait_for)
                session = _Session(store, writer, report, opened, at_work, stopped)
                held.enter_context(closing(session)).work()
            else:
                report.stop()
            report.write()
        except StudyError as error:
            report.end("failed", str(error))
            raise
        except BaseException:
            report.end("stopped", "interrupted; nothing that ended before is lost")
            raise
    return report.status


class _Report:
    """The status of one session of a study, which is written from its start on."""

    def __init__(self, store: Store, writer: Writer, on_status: Callable[[Status], None]) -> None:
        """Start the clock of the session; the arguments are those of :func:`run_study`."""
        self._writer, self._on_status = writer, on_status
        self._spent = float(store.fact("spent") or 0.0)
        self._begin = time.monotonic()
        self.state: Any = "running"
        self.words = ""
        self.details: Callable[[], dict[str, Any]] = dict
        """A function that returns the other fields of the status."""
        self.status = Status("running")
        """As it was written last."""

    @property
    def seconds(self) -> float:
        """The duration of this session, seconds."""
        return time.monotonic() - self._begin

    @property
    def all_seconds(self) -> float:
        """The duration of all sessions together, seconds."""
        return self._spent + self.seconds

    def restart(self, words: str = "") -> None:
        """Restart the session's clock, and write what the study waits for."""
        self._begin = time.monotonic()
        self.wait_for(words)

    def wait_for(self, words: str) -> None:
        """Write a status that says what the study waits for."""
        self.words = words
        self.write()

    def stop(self) -> None:
        """Set the state to ``stopped``."""
        self.state = "stopped"
        self.words = "stopped; nothing that ended before is lost"

    def end(self, state: str, words: str) -> None:
        """Write how the session ended, and why."""
        self.state, self.words = state, words
        self.write()

    def write(self) -> None:
        """Write the current status."""
        self.status = Status(
            self.state,
            self.words,
            seconds=self.seconds,
            all_runs=self._writer.runs,
            all_seconds=self.all_seconds,
            process=os.getpid(),
            written=time.time(),
            **self.details(),
        )
        self._writer.write_status(self.status)
        self._on_status(self.status)


class _Opened(NamedTuple):
    """A study as earlier sessions left it."""

    recordings: Recordings
    judge: Judge
    sampler: Sampler
    ended: set[int]
    """The numbers of the trials that have ended."""
    running: dict[int, dict[str, Any]]
    """The values by key of the trials under way, by number."""


def _open(store: Store, writer: Writer, report: _Report) -> _Opened:
    """Open the recordings and the sampler, and read the results of earlier sessions."""
    definition = store.definition()
    report.details = lambda: {"trials": definition.trials}
    report.wait_for("opening the recordings")
    recordings = open_recordings(definition, report.wait_for)
    check_same(store, writer, recordings)
    trials, running = store.trials(), store.running_trials()
    judge = Judge(recordings.objectives, trials, writer.outcome)
    sampler = Sampler(definition, recordings.objectives, recordings.bases, trials, running)
    ended = {trial.number for trial in trials}
    report.details = lambda: {"done": len(ended), "trials": sampler.trials}
    return _Opened(recordings, judge, sampler, ended, running)


class _Session:
    """One session of a study: the time from a start to the next end or interruption."""

    def __init__(
        self,
        store: Store,
        writer: Writer,
        report: _Report,
        opened: _Opened,
        crew: Crew,
        stopped: Callable[[], bool],
    ) -> None:
        """Go on with a study whose workers have started.

        Args:
            store: The folder of the study.
            writer: The writer of its results.
            report: The status.
            opened: The study as it was left.
            crew: The workers.
            stopped: A callback that returns whether to stop.
        """
        self._store, self._writer, self._report = store, writer, report
        self._crew, self._stopped = crew, stopped
        self._definition: StudyDefinition = store.definition()
        self._recordings, self._judge, self._sampler, self._ended, running = opened
        self._active: dict[int, Active] = {}
        self._waiting: dict[str, list[Active]] = {}
        self._pace = Pace()
        self._slots = crew.slots
        self._last_status = 0.0
        for number, values in running.items():
            self._activate(number, values)
        known = store.fact("importance") or {"trials": 0}
        self._estimator = ImportanceEstimator(
            self._definition.varied, self._sampler.defaults, known["trials"]
        )
        report.details = self._details

    def close(self) -> None:
        """Store the time that was spent, and end the thread that estimates the importance."""
        self._estimator.close()
        self._writer.put_facts(spent=self._report.all_seconds)

    # the loop

    def work(self) -> None:
        """Run trials until all have ended, the time is over, or the study is stopped."""
        self._report.restart()
        for active in list(self._active.values()):
            self._send(active)
        while not self._is_stopped():
            self._fill()
            if not self._active:
                words = self._why_done()
                self._update_importance(last=True)
                if self._definition.propose and not self._propose():
                    break
                self._report.state, self._report.words = "done", words
                return
            self._receive(self._crew.finished(SECONDS_BETWEEN))
            self._at_intervals()
        self._report.stop()

    def _fill(self) -> None:
        """Ask the sampler for trials until enough runs are queued for all workers."""
        while len(self._waiting) < self._slots * (1 + AHEAD) and self._may_ask():
            number, values = self._sampler.ask()
            self._writer.begin(number, values)
            active = self._activate(number, values)
            self._send(active)
            if active.all_ended:  # all runs of the trial are stored already
                self._receive()

    def _may_ask(self) -> bool:
        """Whether another trial may begin; the trial of the defaults may at any time."""
        if self._sampler.left <= 0 or self._stopped():
            return False
        return not self._sampler.has_begun or self._minutes_left() > 0.0

    def _minutes_left(self, share: float | None = None) -> float:
        """Return the remaining time, minutes; infinity if it is not limited.

        Args:
            share: The share of the study's time that may be used; None for that of the search.
        """
        if self._definition.minutes is None:
            return float("inf")
        if share is None:
            share = SEARCH_SHARE if self._definition.propose else 1.0
        return share * self._definition.minutes - (self._report.all_seconds) / 60.0

    def _activate(self, number: int, values: dict[str, Any]) -> Active:
        """Return an open trial with a number and values, which is active from now on."""
        # trial 0 has the defaults of each recording, which may differ; the values are of the first
        jobs = self._recordings.jobs({} if number == 0 else values)
        active = self._active[number] = Active(number, values, jobs)
        return active

    def _send(self, active: Active) -> None:
        """Submit the next runs of a trial, without those whose outcomes are stored already."""
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
                self._crew.submit(job, -active.number)
        active.sent = upto
        active.wanted = len({row.key for row, _ in active.jobs[:upto]})

    def _propose(self) -> bool:
        """Evaluate the best trials again and store the proposal; False if the study was stopped."""
        if self._store.fact("tuned") is not None:
            return True
        definition = self._definition
        first = max(definition.seeds) + 1
        proposer = Proposer(
            self._recordings,
            self._store.trials(),
            self._sampler.defaults,
            definition.start if self._sampler.fixed > 1 else {},
            range(first, first + definition.propose),
            self._measure,
        )
        self._report.words = "measuring the best again on other seeds"
        found = proposer.propose()
        if self._is_stopped():
            return False
        self._writer.put_facts(tuned=found)
        return True

    def _measure(self, jobs: Sequence[Job]) -> dict[str, Outcome]:
        """Have workers do jobs of no trial, as far as the time allows, and return the outcomes by
        key."""
        found: dict[str, Outcome] = {}
        wanted = {job.key: job for job in jobs}
        for key, job in wanted.items():
            if (kept := self._writer.outcome(key)) is not None:
                found[key] = kept
            elif self._minutes_left(1.0) > 0.0:
                self._waiting[key] = []
                self._crew.submit(job)
        while self._waiting and not self._is_stopped():
            for outcome in self._crew.finished(SECONDS_BETWEEN):
                self._record_outcome(outcome)
                found[outcome.key] = outcome
            if time.monotonic() - self._last_status >= SECONDS_BETWEEN:
                self._write_status()
        return found

    def _is_stopped(self) -> bool:
        """Whether the caller or another process requested the study to stop."""
        return self._stopped() or self._store.asked_to_stop()

    def _record_outcome(self, outcome: Outcome) -> None:
        """Store the outcome of a run, and add it to the trials that wait for it."""
        if outcome.became == "done":
            self._writer.keep(outcome)
        self._pace.count(outcome.seconds)
        for active in self._waiting.pop(outcome.key, ()):
            active.outcomes[outcome.key] = outcome

    def _receive(self, outcomes: Sequence[Outcome] = ()) -> None:
        """Store outcomes, and end the trials whose runs have all ended.

        All results are on disk before they are reported to the sampler.
        """
        ended: list[Trial] = []
        with self._writer.transaction():
            for outcome in outcomes:
                self._record_outcome(outcome)
            for number in sorted(self._active):
                if (trial := self._continued(self._active[number])) is not None:
                    ended.append(trial)
        for trial in ended:
            self._sampler.tell(trial)

    def _continued(self, active: Active) -> Trial | None:
        """Submit the next runs of a trial, or end it.

        Returns:
            The trial if it ended; None otherwise. No trial ends before that of the defaults, with
            which it is compared.
        """
        while active.all_ended:
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
                if not hopeless or active.number < self._sampler.fixed:
                    self._send(active)
                    continue
            return self._end(active, failed)
        return None

    def _end(self, active: Active, failed: Outcome | None) -> Trial:
        """Judge and store a trial.

        Args:
            active: The trial.
            failed: The outcome of a run that failed; None if none did.
        """
        rows = tuple(row for row, _ in active.jobs[: active.sent])
        words = "the defaults" if active.number == 0 else ""
        if active.number == 1 and self._sampler.fixed > 1:
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

    # the status

    def _at_intervals(self) -> None:
        """Write the status and the importance, if the last status is old enough."""
        if time.monotonic() - self._last_status >= SECONDS_BETWEEN:
            self._slots = self._crew.slots
            self._report.words = "" if self._crew.workers() else "waits for a worker"
            self._update_importance()
            self._write_status()

    def _write_status(self) -> None:
        """Write the status, and store the time that was spent."""
        self._report.write()
        self._writer.put_facts(spent=self._report.all_seconds)
        self._last_status = time.monotonic()

    def _details(self) -> dict[str, Any]:
        """Return the fields of the status that this session knows."""
        done, running = len(self._ended), self._report.state == "running"
        return {
            "done": done,
            "trials": self._sampler.trials,
            "runs": self._pace.runs,
            "seconds_left": self._seconds_left(done) if running else None,
            "busy": self._pace.busy(self._slots),
            "workers": worker_rows(self._crew.workers(), self._waiting) if running else [],
        }

    def _seconds_left(self, done: int) -> float | None:
        """Return the estimated time to the end, seconds; None if it is not known."""
        left = self._pace.seconds_left(done, self._sampler.trials)
        return None if left is None else max(0.0, min(left, 60.0 * self._minutes_left()))

    def _why_done(self) -> str:
        """Return why there are no more trials, in words; empty if all have ended."""
        if len(self._ended) >= self._sampler.trials or self._definition.minutes is None:
            return ""
        return f"the {self._definition.minutes:g} minutes are over"

    def _update_importance(self, *, last: bool = False) -> None:
        """Store the importance of the parameters if there is a new estimate."""
        found = self._estimator.update(self._judge.complete, last=last)
        if found is not None:
            self._writer.put_facts(importance=found)


@dataclass(eq=False)
class Active:
    """A trial whose runs are being computed."""

    number: int
    """The number of the trial."""
    values: dict[str, Any]
    """The varied parameters, by key."""
    jobs: list[tuple[JobRow, Job]]
    """All runs of the trial."""
    sent: int = 0
    """The number of runs that were submitted, the first ones of :attr:`jobs`."""
    wanted: int = 0
    """The number of different runs among those that were submitted."""
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    """The outcomes of the runs that ended, by key."""

    @property
    def all_ended(self) -> bool:
        """Whether all runs that were submitted have ended."""
        return len(self.outcomes) >= self.wanted


def worker_rows(
    workers: Iterable[WorkerState], waiting: Mapping[str, Sequence[Active]]
) -> list[dict[str, Any]]:
    """Return the activity of each worker, as plain values.

    Args:
        workers: The states of the workers.
        waiting: The trials that wait for each run, by the key of the run's job.
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
        self._warm: float | None = None
        """The time when the first run ended, on the monotonic clock, seconds."""
        self._since_warm = 0.0
        """The time that workers spent on runs that ended later, seconds."""
        self._first: tuple[float, int] | None = None
        """The time of the first estimate, and the number of trials that had ended then."""

    def count(self, seconds: float) -> None:
        """Count a run that ended, and on which a worker spent so many seconds."""
        self.runs += 1
        if self._warm is None:
            self._warm = time.monotonic()
        else:
            self._since_warm += seconds

    def busy(self, slots: int) -> float | None:
        """Return the share of the workers' time in which they worked, 0 … 1, since the first run
        ended; None before two runs for each worker have ended.

        Args:
            slots: The number of runs that are computed at a time.
        """
        if self._warm is None or self.runs < 2 * slots:
            return None
        elapsed = time.monotonic() - self._warm
        return min(1.0, self._since_warm / (elapsed * slots)) if elapsed > 0.0 else None

    def seconds_left(self, done: int, trials: int) -> float | None:
        """Estimate the remaining time, seconds, from the mean time between ends of trials; None
        before two trials have ended since the first call.

        Args:
            done: The number of trials that have ended.
            trials: The number of all trials.
        """
        if self._first is None:
            self._first = time.monotonic(), done
        begin, before = self._first
        if done - before < 2:
            return None
        return (trials - done) * (time.monotonic() - begin) / (done - before)

"""A study at work: asks for trials, has their runs done, keeps what comes back.

Everything that ended is on disk before the sampler hears of it, so that the program may be ended
at any moment: the next start goes on with the trials that were under way, and takes the runs that
ended from the disk.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any

from tracker.studies.active import Active, at_work
from tracker.studies.defined.definition import Definition
from tracker.studies.defined.space import defaults_of
from tracker.studies.errors import StudyError
from tracker.studies.found.proposing import SEARCH_SHARE, Proposer
from tracker.studies.found.weighing import Weighing
from tracker.studies.judging import Judge
from tracker.studies.kept.records import Status, Trial
from tracker.studies.kept.store import JOURNAL, Store
from tracker.studies.kept.writer import Writer
from tracker.studies.opened import Recordings, check_same, open_recordings
from tracker.studies.pace import Pace
from tracker.studies.sampling import Sampler, first_values
from tracker.studies.turn import turn
from tracker.studies.work.cluster import Crew
from tracker.studies.work.jobs import Job, Outcome

SECONDS_BETWEEN = 0.5
"""How often the status is written and the wish to stop is heard."""

AHEAD = 1
"""Runs that wait beside each one under way, so that no worker waits for the sampler."""


def run_study(
    store: Store,
    writer: Writer,
    crew: Callable[[Callable[[str], None]], Crew],
    *,
    told: Callable[[Status], None] = lambda status: None,
    stopped: Callable[[], bool] = lambda: False,
    beside: bool = False,
) -> Status:
    """Run a study, or go on with it, to its end.

    Args:
        store: Its folder.
        writer: From :meth:`~tracker.studies.kept.store.Store.running`.
        crew: Makes the workers; given whom to tell what is being waited for.
        told: Called with the status now and then.
        stopped: Asked as often.
        beside: Whether it runs beside other studies, since its workers are not this machine's;
            else it waits for its turn.

    Returns:
        The status at the end: ``done``, or ``stopped`` where that was asked for.

    Raises:
        StudyError: If it cannot go on, with what to do; the status says the same.
    """
    study = _Running(store, writer, told, stopped)
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
    """One start of a study."""

    crew: Crew

    def __init__(
        self,
        store: Store,
        writer: Writer,
        told: Callable[[Status], None],
        stopped: Callable[[], bool],
    ) -> None:
        self._store, self._writer, self._told, self._stopped = store, writer, told, stopped
        self._definition: Definition = store.definition()
        self._active: dict[int, Active] = {}
        self._waiting: dict[str, list[Active]] = {}
        self._queue: list[dict[str, Any]] = []
        self._begin = time.monotonic()
        self._spent = float(store.told("spent") or 0.0)
        self._pace = Pace()
        self._said = 0.0
        self._slots = 1
        self.state: Any = "running"
        self.words = ""
        self.status = Status("running")

    def prepare(self) -> None:
        """Open the recordings, and take up what was done before."""
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
            if number in by_number:  # ended before the sampler heard of it
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
        """Close what the sampler keeps."""
        if hasattr(self, "_sampler"):
            self._sampler.close()

    # the loop

    def work(self) -> None:
        """Until all trials have ended, the time is over, or somebody stops it."""
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
            self._settle(self.crew.finished(SECONDS_BETWEEN))
            self._now_and_then()
        self.end_early()

    def end_early(self) -> None:
        """Be stopped, with everything kept."""
        self.state = "stopped"
        self.words = "stopped; nothing that ended before is lost"

    def _fill(self) -> None:
        """Ask for trials until nobody will wait."""
        while len(self._waiting) < self._slots * (1 + AHEAD) and self._may_ask():
            values = self._queue.pop(0) if self._queue else None
            number, drawn = self._sampler.ask(values)
            self._asked = number + 1
            if number < self._fixed and values is not None:
                drawn = values if number == 0 else drawn | values
            active = self._take_up(number, drawn)
            self._send(active)
            if active.is_back:  # all its runs are there from other trials
                self._settle()

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
        # on each recording its own defaults: nothing is changed
        jobs = self._recordings.jobs({} if number == 0 else values)
        active = self._active[number] = Active(number, values, jobs)
        return active

    def _send(self, active: Active) -> None:
        """Have the next runs of a trial done; those that ended before are there at once."""
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
        """Measure the best again on other seeds; False where somebody stopped it."""
        if self._store.told("tuned") is not None:
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
        self._writer.tell("tuned", found)
        return True

    def _measure(self, jobs: Sequence[Job]) -> dict[str, Outcome]:
        """Have jobs done that are no trial's, as far as the time goes."""
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
            if time.monotonic() - self._said >= SECONDS_BETWEEN:
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

    def _settle(self, outcomes: Sequence[Outcome] = ()) -> None:
        """Take up runs that ended, and end the trials that have all of theirs.

        All is on disk before the sampler hears of it.
        """
        ended = []
        with self._writer.together():
            for outcome in outcomes:
                self._came(outcome)
            for number in sorted(self._active):
                if (trial := self._gone_on(self._active[number])) is not None:
                    ended.append(trial)
        for trial in ended:
            self._sampler_hears(trial)

    def _gone_on(self, active: Active) -> Trial | None:
        """A trial that ended now; none before the defaults, by which it is judged."""
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

    # what is told

    def wait_for(self, words: str) -> None:
        """Say what is being waited for."""
        self.words = words
        self.say()

    def waits(self, words: str) -> bool:
        """Say what is being waited for, at no cost of its time; False where somebody stops it."""
        self._begin = time.monotonic()
        self.wait_for(words)
        return not self._is_stopped()

    def _now_and_then(self) -> None:
        if time.monotonic() - self._said >= SECONDS_BETWEEN:
            self._slots = self.crew.slots
            self.words = "" if self.crew.workers() else "waits for a worker"
            self._weigh()
            self.say()

    def say(self) -> None:
        """Write down how far it is."""
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
        self._writer.say(self.status)
        if hasattr(self, "_trials"):
            self._writer.tell("spent", self._spent + seconds)
        self._told(self.status)
        self._said = time.monotonic()

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
        """Write down what matters, where that was found out anew."""
        found = self._weighing.news(
            self._judge.complete, self.crew, worked=self._pace.worked, last=last
        )
        if found is not None:
            self._writer.tell("importance", found)

"""The choice of the next trial's values by Optuna, whose storage is a file of the study.

[AYY19] Akiba, Sano, Yanase, Ohta, Koyama, "Optuna: a next-generation hyperparameter optimization
framework", KDD 2019. TPE: Bergstra, Bardenet, Bengio, Kégl, NeurIPS 2011; for several objectives
NSGA-II: Deb, Pratap, Agarwal, Meyarivan, IEEE TEVC 6(2), 2002.
"""

from __future__ import annotations

import heapq
import itertools
import json
import os
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tracker.parameters.catalogue import RunParameters
from tracker.studies.definition import space
from tracker.studies.definition.definition import Definition, Varied
from tracker.studies.definition.objectives import Objective
from tracker.studies.errors import StudyError

STARTUP = 12
"""The number of random trials before TPE is used."""

BEST = 100
LAST = 400
"""The numbers of best and of last trials that TPE uses in a long search, so that the time for a new
trial does not grow with the number of trials. TPE compares at most 25 good trials with all others,
among which old ones have little weight; the good ones are still the best of all trials."""


def first_values(definition: Definition, defaults: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the values of the first trials: the defaults, and the defaults with the user's own
    values if these differ."""
    first, start = [defaults], dict(definition.start or {})
    if start and start != {key: defaults[key] for key in start}:
        first.append({**defaults, **start})
    return first


class Sampler:
    """The sampler, which asks Optuna for the values of each trial and reports the results to it.

    Trials without a result are in the journal: when it is opened again, they are still open, with
    the same numbers and values.
    """

    def __init__(
        self,
        path: Path,
        definition: Definition,
        objectives: Sequence[Objective],
        bases: Sequence[RunParameters],
    ) -> None:
        """Open the journal, or make it.

        Args:
            path: The file of Optuna's journal.
            definition: The study's definition.
            objectives: The objectives whose values are reported.
            bases: The parameters on each recording with the fixed values of the study.

        Raises:
            StudyError: If the file cannot be read.
        """
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._optuna: Any = optuna
        self._definition, self._bases = definition, bases
        self._varied = {one.key: one for one in definition.varied}
        self._single = len(objectives) == 1
        self._journal: Journal | None = None
        try:
            self._journal = Journal(path)
            self._study: Any = optuna.create_study(
                storage=storage(self._journal, minimized=self._minimized(objectives)),
                study_name=definition.name,
                directions=["maximize" if one.higher else "minimize" for one in objectives],
                sampler=self._sampler(),
                load_if_exists=True,
            )
            self._study.get_trials(
                deepcopy=False
            )  # reads the file here, where exceptions are handled
        except (ValueError, LookupError, TypeError, AttributeError, AssertionError,
                RecursionError) as error:  # fmt: skip
            self.close()
            raise StudyError(
                f"{path}: the record of what was tried cannot be read ({error}); the results are "
                "in results.sqlite3 beside it: start a new study with what they show"
            ) from None
        self._trials: dict[int, Any] = {}

    def close(self) -> None:
        """Close the file."""
        if self._journal is not None:
            self._journal.close()

    def _sampler(self) -> Any:
        """Return Optuna's sampler for the search method of the study."""
        samplers, seed = self._optuna.samplers, self._definition.seed
        search = self._definition.search
        if search == "auto":
            search = "tpe" if self._single else "nsga2"
        if search == "tpe":
            return samplers.TPESampler(
                multivariate=True, constant_liar=True, n_startup_trials=STARTUP, seed=seed
            )
        if search == "nsga2":
            size = max(8, min(50, self._definition.trials // 5))
            return samplers.NSGAIISampler(population_size=size, seed=seed)
        return samplers.RandomSampler(seed=seed)

    def _minimized(self, objectives: Sequence[Objective]) -> bool | None:
        """Whether the smallest value is the best, for a search by TPE; None for other searches."""
        by_tpe = self._single and self._definition.search in ("auto", "tpe")
        return not objectives[0].higher if by_tpe else None

    @property
    def asked(self) -> int:
        """The number of trials that were asked for, in all sessions."""
        return len(self._study.get_trials(deepcopy=False))

    def open_trials(self) -> list[int]:
        """Return the numbers of trials that were asked for and have no result."""
        state = self._optuna.trial.TrialState
        found = self._study.get_trials(deepcopy=False, states=(state.RUNNING,))
        return [trial.number for trial in found]

    def resume(self, number: int) -> dict[str, Any]:
        """Continue an open trial, and return its values by key."""
        trials = self._study.get_trials(deepcopy=False)
        identity = trials[number]._trial_id
        self._trials[number] = self._optuna.trial.Trial(self._study, identity)
        return self._drawn(number)

    def ask(self, values: Mapping[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Ask for a trial, and return its number and values.

        Args:
            values: The values to try; None if the sampler chooses them.
        """
        assert self._journal is not None
        with self._journal.transaction():
            if values is not None:
                fit = {k: v for k, v in values.items() if self._varied[k].contains(v)}
                self._study.enqueue_trial(fit)
            trial = self._study.ask()
            self._trials[trial.number] = trial
            return trial.number, self._drawn(trial.number)

    def _drawn(self, number: int) -> dict[str, Any]:
        """Return the values that the sampler draws for an open trial, by key."""
        trial = self._trials[number]

        def draw(one: Varied) -> Any:
            if one.choices:
                return trial.suggest_categorical(one.key, list(one.choices))
            assert one.low is not None
            assert one.high is not None
            if one.is_whole:
                return trial.suggest_int(one.key, int(one.low), int(one.high), log=one.log)
            return trial.suggest_float(one.key, one.low, one.high, log=one.log)

        return space.drawn(self._definition.varied, self._bases, draw)

    def tell(self, number: int, values: Sequence[float] | None, *, pruned: bool = False) -> None:
        """Report the result of a trial.

        Args:
            number: The trial's number.
            values: The values of the objectives; None if the trial failed.
            pruned: Whether the trial was pruned, so that the values are those of its first runs.
        """
        trial, state = self._trials.pop(number), self._optuna.trial.TrialState
        assert self._journal is not None
        with self._journal.transaction():
            if values is None:
                self._study.tell(trial, state=state.FAIL)
            elif pruned:
                if self._single:
                    trial.report(float(values[0]), 0)
                self._study.tell(trial, state=state.PRUNED)
            else:
                self._study.tell(trial, [float(one) for one in values])

    def grid(self) -> list[dict[str, Any]]:
        """Return the values of all trials of a grid.

        Raises:
            StudyError: If there are more than the study's largest number of trials.
        """
        most = self._definition.trials
        found = list(itertools.islice(space.grid(self._definition.varied, self._bases), most + 1))
        if len(found) > most:
            raise StudyError(
                f"search = grid: there are more combinations than the {most} trials; raise trials, "
                "take fewer steps, or another search"
            )
        return found


class Journal:
    """A journal backend of Optuna without a lock, written by one process.

    An incomplete last line, which a killed process may leave, is removed. Lines are written at once
    but not forced to disk: if the machine loses power, the values of the last trials may be lost,
    but not their results, which the file of results has.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or make it.

        Raises:
            ValueError: If the file is not a journal.
        """
        whole = path.read_bytes() if path.exists() else b""
        complete = whole[: whole.rfind(b"\n") + 1]
        if len(complete) < len(whole):
            with path.open("r+b") as file:
                file.truncate(len(complete))
        self._path = path
        self._lines: list[dict[str, Any]] = [json.loads(one) for one in complete.splitlines()]
        self._first = 0
        self._file = path.open("ab", buffering=0)
        self._size = len(complete)
        self._waiting: list[bytes] | None = None

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Yield the lines from a number on; earlier lines are removed from memory, since Optuna
        reads each line only once."""
        del self._lines[: log_number_from - self._first]
        self._first = max(self._first, log_number_from)
        yield from list(self._lines)

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append lines, all or none.

        Raises:
            StudyError: If they cannot be written.
        """
        texts = [json.dumps(one, separators=(",", ":")).encode() + b"\n" for one in logs]
        if self._waiting is None:
            self._write(b"".join(texts))
        else:
            self._waiting += texts
        self._lines += [json.loads(one) for one in texts]

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Collect the lines of the block, and write them at its end, all or none."""
        self._waiting = []
        try:
            yield
        finally:
            waiting, self._waiting = self._waiting, None
            self._write(b"".join(waiting))

    def _write(self, data: bytes) -> None:
        """Write bytes at the end of the file, or restore its size if that fails."""
        try:
            if data and self._file.write(data) != len(data):
                raise OSError(28, "No space left on device")
        except OSError as error:
            os.ftruncate(self._file.fileno(), self._size)
            raise StudyError(
                f"{self._path}: cannot be written ({error.strerror}); free some space and go on "
                "by `multiview-phd study resume`: every run that ended is kept"
            ) from None
        self._size += len(data)


def storage(journal: Any, *, minimized: bool | None) -> Any:
    """Return Optuna's storage on a journal.

    Args:
        journal: A :class:`Journal`, which has the methods of Optuna's backends.
        minimized: Whether the smallest value is the best, for a search by TPE; None for other
            searches, which use all trials.
    """
    from optuna.storages import JournalStorage
    from optuna.trial import TrialState

    class Storage(JournalStorage):
        """A storage that does not search all trials for waiting ones, and that gives TPE only the
        best and the last trials."""

        _waits = True  # an earlier process may have left waiting trials

        def create_new_trial(self, study_id: int, template_trial: Any = None) -> int:
            self._waits |= template_trial is not None
            number: int = super().create_new_trial(study_id, template_trial)
            return number

        def get_all_trials(
            self, study_id: int, deepcopy: bool = True, states: Container[Any] | None = None
        ) -> list[Any]:
            if states == (TrialState.WAITING,):
                if not self._waits:
                    return []
                waiting: list[Any] = super().get_all_trials(study_id, deepcopy, states)
                self._waits = bool(waiting)
                return waiting
            found: list[Any] = super().get_all_trials(study_id, deepcopy, states)
            if minimized is None or states is None or TrialState.COMPLETE not in states:
                return found
            if len(found) <= BEST + LAST:
                return found
            last = found[-LAST:]
            early = [one for one in found[:-LAST] if one.state == TrialState.COMPLETE]
            sign = 1.0 if minimized else -1.0
            best = heapq.nsmallest(BEST, early, key=lambda one: sign * one.value)
            return sorted([*best, *last], key=lambda one: one.number)

    return Storage(journal)

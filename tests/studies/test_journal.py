"""What Optuna is given to read of the study's own file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import optuna
import pytest

from tracker.studies.sampling import Journal, storage


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with closing(Journal(path)) as journal:
        kept = storage(journal, minimized=None)
        sampler = optuna.samplers.RandomSampler(seed=0)
        yield (
            kept,
            optuna.create_study(storage=kept, study_name="s", sampler=sampler, load_if_exists=True),
        )


def test_what_was_enqueued_is_tried_next_whenever_that_was(tmp_path: Path) -> None:
    """Between others, several at a time, and by a start that did not enqueue it."""

    def asked(study: Any) -> float:
        return float(study.ask().suggest_float("x", 0.0, 1.0))

    with opened(tmp_path / "journal") as (_, study):
        drawn = {asked(study), asked(study)}
        study.enqueue_trial({"x": 0.25})
        study.enqueue_trial({"x": 0.75})
        assert [asked(study), asked(study)] == [0.25, 0.75]
        assert asked(study) not in drawn | {0.25, 0.75}
        study.enqueue_trial({"x": 0.5})
    with opened(tmp_path / "journal") as (_, study):
        assert asked(study) == 0.5
        assert asked(study) not in {0.25, 0.5, 0.75}


def test_who_waits_is_not_sought_among_all_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[Any] = []
    whole = optuna.storages.JournalStorage.get_all_trials

    def looking(self: Any, *arguments: Any, **named: Any) -> list[Any]:
        looks.append(arguments or named)
        return whole(self, *arguments, **named)

    with opened(tmp_path / "journal") as (kept, study):
        study.tell(study.ask(), 0.0)
        monkeypatch.setattr(optuna.storages.JournalStorage, "get_all_trials", looking)
        for _ in range(5):
            study.tell(study.ask(), 0.0)
        assert not looks
        assert len(kept.get_all_trials(0)) == 6

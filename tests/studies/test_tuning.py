"""What is proposed was measured again, is never worse than the defaults, and changes no more than
it must."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.studies.small import Serial, definition, recording, run
from tracker.parameters.catalogue import PARAMETERS
from tracker.studies.errors import StudyError
from tracker.studies.jobs import Job, Outcome
from tracker.studies.report import report_html
from tracker.studies.store import Store, create, free_name
from tracker.studies.tuning import tuning


def study(folder: Path, **fields: Any) -> Store:
    made = definition(folder, propose=3, trials=40, prune=False, **fields)
    return create(made, folder / "studies")


def outcome(job: Job, score: float) -> Outcome:
    figures = {"score": score, "hota": score, "idf1": score, "speed": 9.0}
    return Outcome(job.key, "done", figures=figures, overlap=0.5, tracks=job.key, seconds=0.01)


def of(job: Job, key: str) -> float:
    return float(dict(job.values).get(key, PARAMETERS[key].default))


def test_what_was_luck_is_not_proposed(tmp_path: Path) -> None:
    """The seed of the trials likes another rate, no other seed does."""

    def do(job: Job) -> Outcome:
        lucky = job.seed == 0 and of(job, "fusion.clutter_rate") != 3.0
        return outcome(job, 0.9 if lucky else 0.8 - abs(of(job, "fusion.clutter_rate") - 3.0))

    store = study(tmp_path)
    run(store, Serial(do))
    found = store.fact("tuned")
    assert not found["better"]
    assert found["words"] == "nothing better was found"
    assert found["seeds"] == [1, 2, 3]


def test_what_brings_something_is_proposed_without_what_does_not(tmp_path: Path) -> None:
    def do(job: Job) -> Outcome:
        return outcome(job, 0.9 - 0.1 * abs(of(job, "fusion.detection_probability") - 0.7))

    store = study(tmp_path)
    run(store, Serial(do))
    found = store.fact("tuned")
    assert found["better"]
    (row,) = found["rows"]
    assert row["key"] == "fusion.detection_probability"
    assert row["after"] == pytest.approx(0.7, abs=0.1)
    assert row["brought"] > 0.01
    assert found["values"]["fusion.clutter_rate"] == 3.0
    score = next(one for one in found["figures"] if one["key"] == "score")
    assert score["after"] > score["default"]
    page = report_html(store)
    headings = re.findall("<h2>(.*?)</h2>", page)
    assert headings == ["Proposed", "Figures", "Best trials", "Repeat the best one", "Definition"]
    assert f"{row['brought']:+.4f}" in page
    assert "trials below" in page  # what failed takes no room from what tells something


def test_from_a_bad_start_it_comes_back_to_the_defaults(tmp_path: Path) -> None:
    def do(job: Job) -> Outcome:
        return outcome(job, 0.9 - 0.01 * abs(of(job, "fusion.clutter_rate") - 3.0))

    store = study(tmp_path, start={"fusion.clutter_rate": 10.0})
    run(store, Serial(do))
    assert store.trial(1).values["fusion.clutter_rate"] == 10.0
    assert store.trial(1).words == "where you were"
    found = store.fact("tuned")
    assert found["better"]
    assert found["values"]["fusion.clutter_rate"] == 3.0
    (row,) = found["rows"]
    assert (row["before"], row["after"]) == (10.0, 3.0)


@pytest.mark.full
def test_a_method_that_draws_nothing_is_told(tmp_path: Path) -> None:
    store = study(tmp_path)
    run(store, Serial())  # boxes: the tracks are the same for every seed
    found = store.fact("tuned")
    assert "nothing is drawn at random here" in found["words"]
    assert found["seeds"] == [0]


def test_ended_while_it_measures_again_it_goes_on(tmp_path: Path) -> None:
    def do(job: Job) -> Outcome:
        return outcome(job, 0.9 - 0.1 * abs(of(job, "fusion.detection_probability") - 0.7))

    store = study(tmp_path)
    first = Serial(do, stop_after=44)
    with pytest.raises(KeyboardInterrupt):
        run(store, first)
    assert len(store.trials()) == 40
    assert store.fact("tuned") is None
    second = Serial(do)
    run(store, second)
    assert store.fact("tuned")["better"]
    assert not set(first.done) & set(second.done)


def test_the_dozen_are_varied_around_where_somebody_is(tmp_path: Path) -> None:
    place = recording(tmp_path / "recording")
    changes = {"fusion.detection_probability": 0.6, "fusion.duplicate_distance": 0.4}
    made = tuning("t", [str(place)], minutes=5.0, changes=changes)
    assert 8 <= len(made.varied) <= 12
    assert made.objectives == ("score",)
    assert dict(made.start) == {"fusion.detection_probability": 0.6}
    assert dict(made.values) == {"fusion.duplicate_distance": 0.4}
    for one in made.varied:
        now = made.start.get(one.key, PARAMETERS[one.key].default)
        assert one.nearest(now) == now
    blind = tuning("t", [str(place)], minutes=5.0, changes={}, ignore_truth=True)
    assert blind.objectives == ("identity",)
    with pytest.raises(StudyError, match="cannot be read"):
        tuning("t", [str(tmp_path / "nothing")], minutes=5.0, changes={})


def test_a_built_in_room_is_tuned_though_a_folder_of_its_name_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording(tmp_path / "room44-3p")
    monkeypatch.chdir(tmp_path)
    for name, place in (
        ("room44-3p", "room44-3p"), ("./room44-3p", str(tmp_path / "room44-3p")),
    ):  # fmt: skip
        assert tuning("t", [name], minutes=1.0, changes={}).recordings == (place,)


def test_speeds_are_not_compared_since_the_first_run_has_the_start_of_the_program(
    tmp_path: Path,
) -> None:
    def do(job: Job) -> Outcome:
        found = outcome(job, 0.9 - 0.1 * abs(of(job, "fusion.detection_probability") - 0.7))
        found.figures["speed"] = 100.0 if job.values else 8.0
        return found

    store = study(tmp_path)
    run(store, Serial(do))
    compared = {
        row["key"]: (row["default"], row["after"]) for row in store.fact("tuned")["figures"]
    }
    assert list(compared) == ["score", "hota", "idf1"]
    assert compared["score"][0] < compared["score"][1]


@pytest.mark.parametrize(
    ("words", "plain"),
    [
        ("tune Hall (north) [2] & yard", "tune Hall -north- -2- - yard"),
        ("tune größe_1.5 m²", "tune größe_1.5 m"),
        ("tune " + 90 * "a", "tune " + 45 * "a"),
        ("(…)", "study"),
        ("", "study"),
    ],
)
def test_any_words_give_a_name_that_is_free(tmp_path: Path, words: str, plain: str) -> None:
    for number in (1, 2):
        name = free_name(words, tmp_path / "studies")
        assert name == f"{plain} {number}"
        create(definition(tmp_path, name), tmp_path / "studies")

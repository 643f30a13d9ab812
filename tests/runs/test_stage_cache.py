"""The stage cache: what was computed is not computed again, and a run from it is the same run."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.engine.synthetic import crossing, sequence, views_at
from tests.runs.test_pipeline import assert_same, stopped
from tests.synthetic import write_sequence
from tracker import fusion, single_view
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.protocol import FusionResult
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import numbers_version, pipeline, stage_cache
from tracker.runs.numbers_version import numbers_version as version_of
from tracker.runs.pipeline import Cancelled, Run, compute, stage_keys
from tracker.runs.stage_cache import FusionColumn, StageCache, TrackColumn, ViewColumn, bytes_of
from tracker.runs.stage_files import StageFiles
from tracker.sequences.reader import read_sequence
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps

STEPS = 30
WHOLE = sequence(crossing(STEPS), STEPS, clutter_rate=0.5)
BOXES = RunParameters(single_view="none")


def changed(**values: Any) -> RunParameters:
    """Boxes as they are, with some values of the fusion changed."""
    return with_values(BOXES, {f"fusion.{name}": value for name, value in values.items()})


@pytest.fixture(autouse=True)
def _told_after_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "PROGRESS_SECONDS", 0.0)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Counts the steps that the stages really do."""
    counts = {"single_view": 0, "fusion": 0}

    def counted(stage: str, create: Any) -> Any:
        def make(*arguments: Any) -> Any:
            method = create(*arguments)
            step = method.step

            def count(*values: Any) -> Any:
                counts[stage] += 1
                return step(*values)

            method.step = count
            return method

        return make

    monkeypatch.setattr(single_view, "create", counted("single_view", single_view.create))
    monkeypatch.setattr(fusion, "create", counted("fusion", fusion.create))
    return counts


@pytest.mark.full
def test_going_back_to_earlier_values_computes_nothing(steps: dict[str, int]) -> None:
    cache = StageCache()
    values = [0.9, 0.95, 0.97, 0.9, 0.97, 0.95]
    runs = [compute(WHOLE, changed(survival_probability=v), cache=cache) for v in values]
    assert steps == {"single_view": 3 * STEPS, "fusion": 3 * STEPS}
    for value, run in zip(values, runs, strict=True):
        assert_same(run, compute(WHOLE, changed(survival_probability=value)))
    assert runs[3].tracks is runs[0].tracks
    runs[3].fused.append(runs[3].fused[0])
    assert len(compute(WHOLE, changed(survival_probability=0.9), cache=cache).fused) == STEPS


def test_each_stage_is_taken_up_by_its_own_key(steps: dict[str, int]) -> None:
    cache = StageCache()
    compute(WHOLE, BOXES, cache=cache)
    compute(WHOLE, changed(extraction_threshold=0.7), cache=cache)
    assert steps == {"single_view": 3 * STEPS, "fusion": STEPS}
    compute(WHOLE, changed(clutter_rate=2.0, extraction_threshold=0.7), cache=cache)
    assert steps == {"single_view": 3 * STEPS, "fusion": 2 * STEPS}
    compute(WHOLE, with_values(BOXES, {"detection_boxes.size_sigma": 0.3}), cache=cache)
    assert steps == {"single_view": 6 * STEPS, "fusion": 3 * STEPS}
    other = sequence(crossing(STEPS), STEPS, seed=1)
    compute(other, BOXES, cache=cache)
    assert steps == {"single_view": 9 * STEPS, "fusion": 4 * STEPS}
    compute(WHOLE, BOXES, cache=cache)
    assert steps == {"single_view": 9 * STEPS, "fusion": 4 * STEPS}, "the other is remembered too"


def test_a_cancelled_run_is_gone_on_with(steps: dict[str, int]) -> None:
    cache = StageCache()
    seen: list[Run] = []
    with pytest.raises(Cancelled):
        compute(
            WHOLE,
            BOXES,
            cache=cache,
            on_progress=lambda run, _: seen.append(run),
            cancelled=lambda: bool(seen) and seen[-1].done >= 12,
        )
    assert steps["fusion"] == 12
    views = cache.views(seen[0].keys["single_view"], frames=STEPS, cameras=3)
    assert views is not None
    there = len(views.steps)
    before = steps["single_view"]
    whole = compute(WHOLE, BOXES, cache=cache)
    assert steps["fusion"] == STEPS
    assert steps["single_view"] == before + 3 * (STEPS - there)
    assert_same(whole, compute(WHOLE, BOXES))


def test_a_shorter_column_never_replaces_a_longer_one() -> None:
    cache = StageCache()
    long, short = stopped(BOXES, 20, whole=WHOLE), stopped(BOXES, 5, whole=WHOLE)
    for run in (long, short):
        cache.keep_fusion(run.keys["fusion"], FusionColumn(run.fused, run.fusion_state))
        column = ViewColumn(run.views, run.view_states, from_pictures=False)
        cache.keep_views(run.keys["single_view"], column, complete=False)
    fused = cache.fusion(long.keys["fusion"])
    views = cache.views(long.keys["single_view"], frames=STEPS, cameras=3)
    assert fused is not None
    assert views is not None
    assert (len(fused.steps), len(views.steps)) == (20, len(long.views))


def test_a_failing_fusion_leaves_nothing_of_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    cache = StageCache()
    create = fusion.create

    def failing(*arguments: Any) -> Any:
        method = create(*arguments)
        step, count = method.step, iter(range(100))

        def fail(*values: Any) -> Any:
            if next(count) == 10:
                raise ValueError("no number")
            return step(*values)

        method.step = fail  # type: ignore[method-assign]
        return method

    monkeypatch.setattr(fusion, "create", failing)
    with pytest.raises(ValueError, match="no number"):
        compute(WHOLE, BOXES, cache=cache)
    keys = stage_keys(WHOLE, BOXES, 0)
    assert cache.fusion(keys["fusion"]) is None
    assert cache.views(keys["single_view"], frames=STEPS, cameras=3) is not None


def column(count: int, size: int) -> FusionColumn:
    """A column of about ``count`` × ``size`` numbers."""
    nothing = np.zeros((0, 0))
    mixture = GaussianMixture(
        np.arange(float(size)), np.zeros((size, 0)), np.zeros((size, 0, 0)), np.zeros(size, np.int8)
    )
    each = FusionResult(mixture, nothing, nothing, nothing, nothing)
    return FusionColumn(Steps.of([each] * count, FusionResult), None)


def test_memory_stays_within_its_bytes_and_the_newest_stays() -> None:
    cache = StageCache(memory_bytes=120_000)
    for name in "abcdef":
        cache.keep_fusion(name, column(10, 300))
    assert cache.used_bytes <= 120_000
    assert [name for name in "abcdef" if cache.fusion(name)] == ["c", "d", "e", "f"]
    cache.fusion("c")
    cache.keep_fusion("g", column(10, 300))
    assert [name for name in "abcdefg" if cache.fusion(name)] == ["c", "e", "f", "g"]
    cache.keep_fusion("huge", column(10, 3000))
    assert [name for name in "abcdefg" if cache.fusion(name)] == []
    assert cache.fusion("huge") is not None, "a run's own part is always there"
    cache.keep_fusion("h", column(10, 300))
    assert cache.fusion("huge") is None
    assert 0 < cache.used_bytes <= 120_000


def test_later_stages_push_out_no_stage_1() -> None:
    cache = StageCache(memory_bytes=1_000_000, later_bytes=60_000)
    views = Steps.of([tuple(views_at(WHOLE, 0))] * 20, ViewResult, 3)
    cache.keep_views("v", ViewColumn(views, None, from_pictures=False), complete=False)
    alone = cache.used_bytes
    for name in "abcdef":
        cache.keep_fusion(name, column(10, 300))
        assert cache.used_bytes - alone <= 60_000
    assert [name for name in "abcdef" if cache.fusion(name)] == ["e", "f"]
    assert cache.views("v", frames=20, cameras=3) is not None
    cache.keep_views("w", ViewColumn(views, None, from_pictures=False), complete=False)
    cache.keep_views(
        "v", ViewColumn(views.alike([*views, *views]), None, from_pictures=False), complete=False
    )
    assert [name for name in "abcdef" if cache.fusion(name)] == ["e", "f"]
    cache.clear()
    assert cache.used_bytes == 0
    for name in "abcdef":
        cache.keep_fusion(name, column(10, 300))
    assert [name for name in "abcdef" if cache.fusion(name)] == ["e", "f"]


def test_the_newest_of_each_stage_stays() -> None:
    cache = StageCache(memory_bytes=1)
    views = Steps.of([tuple(views_at(WHOLE, 0))], ViewResult, 3)
    cache.keep_views("v", ViewColumn(views, None, from_pictures=False), complete=False)
    for name in "abc":
        cache.keep_fusion(name, column(2, 10))
    assert cache.views("v", frames=9, cameras=3) is not None
    assert cache.fusion("b") is None
    assert cache.fusion("c") is not None


def test_the_bytes_of_a_column_are_those_of_its_arrays() -> None:
    run = compute(WHOLE, BOXES)
    exact = sum(
        array.nbytes
        for step in run.fused
        for array in (
            step.posterior.weights, step.posterior.means, step.posterior.covariances,
            step.posterior.labels, step.detection_probabilities, step.sources,
            step.source_weights, step.hidden_by, step.associations.cameras,
            step.associations.components, step.associations.boxes,
            step.associations.probabilities,
        )
    )  # fmt: skip
    assert 0.9 * exact < bytes_of(FusionColumn(run.fused, None)) < 1.1 * exact + 1000
    column = TrackColumn(run.tracks, run.filtered)
    assert bytes_of(column) >= run.tracks.positions.nbytes + run.filtered.positions.nbytes


@pytest.fixture
def filmed(tmp_path: Path) -> Any:
    """A small recording with pictures."""
    return read_sequence(write_sequence(tmp_path / "filmed", frames=8, container="mp4"))


LIGHT = with_values(RunParameters(), {"colour_phd.samples": 60, "colour_phd.mean_shift_starts": 4})


def test_stage_1_is_there_after_a_new_start(
    filmed: Any, tmp_path: Path, steps: dict[str, int]
) -> None:
    files = StageFiles(tmp_path / "stages")
    first = compute(filmed, LIGHT, cache=StageCache(files=files))
    assert steps["single_view"] == 16
    second = compute(filmed, LIGHT, cache=StageCache(files=files))
    assert steps["single_view"] == 16
    assert_same(first, second)
    # the values that made it are part of its name
    compute(filmed, with_values(LIGHT, {"colour_phd.samples": 61}), cache=StageCache(files=files))
    assert steps["single_view"] == 32
    assert len(list((tmp_path / "stages").glob("*"))) == 2
    shutil.rmtree(tmp_path / "stages")
    third = compute(filmed, LIGHT, cache=StageCache(files=files))
    assert steps["single_view"] == 48
    assert_same(first, third)


def test_only_what_is_complete_and_costly_goes_to_disk(filmed: Any, tmp_path: Path) -> None:
    started: list[Any] = []
    cache = StageCache(files=StageFiles(tmp_path / "stages"), start=started.append)
    compute(filmed, LIGHT, steps=5, cache=cache)
    compute(WHOLE, BOXES, cache=cache)
    assert started == []
    run = compute(filmed, LIGHT, cache=cache)
    assert len(started) == 1
    assert not (tmp_path / "stages").exists()
    started[0]()
    assert (tmp_path / "stages" / run.keys["single_view"]).is_dir()
    compute(filmed, LIGHT, cache=cache)
    assert len(started) == 1


def test_the_cache_folder_is_the_programs(
    filmed: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(tmp_path / "own"))
    compute(filmed, LIGHT, cache=StageCache.on_disk())
    assert len(list((tmp_path / "own" / "stages").glob("*"))) == 1


def test_other_code_has_other_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(numbers_version.__file__).parents[1]
    copy = tmp_path / "tracker"
    shutil.copytree(root, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(numbers_version, "_ROOT", copy)
    uncached = version_of.__wrapped__
    stages = ("single_view", "fusion", "smoothing", "tracks")

    def versions() -> dict[str, str]:
        return {stage: uncached(stage) for stage in stages}

    start = versions()
    assert len(set(start.values())) == 3
    for name, later in (
        ("single_view/colour_phd.py", set(stages)),
        ("kernels/kalman.py", set(stages)),
        ("fusion/model.py", {"fusion", "smoothing", "tracks"}),
        ("smoothing/stage.py", {"smoothing", "tracks"}),
        ("fusion/trajectories.py", {"smoothing", "tracks"}),
        ("evaluation/ospa.py", set()),
    ):
        path = copy / name
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("return", "return 0.5 *", 1), encoding="utf-8")
        now = versions()
        assert {stage for stage in stages if now[stage] != start[stage]} == later, name
        path.write_text(text, encoding="utf-8")
    assert versions() == start
    for package in ("evaluation", "export", "library", "review", "studies"):
        for path in (copy / package).rglob("*.py"):
            path.write_text(path.read_text(encoding="utf-8") + "CHANGED = 1\n", encoding="utf-8")
    assert versions() == start
    monkeypatch.setattr(np, "__version__", "0")
    assert all(versions()[stage] != start[stage] for stage in stages)


def test_every_path_that_is_left_out_of_a_key_is_there() -> None:
    root = Path(numbers_version.__file__).parents[1]
    later = [path for paths in numbers_version.LATER.values() for path in paths]
    for path in (*numbers_version.WITHOUT_EFFECT, *later):
        assert (root / path).is_file() if path.endswith(".py") else (root / path).is_dir(), path
        others = [one.name for one in (root / path).parent.glob(f"{Path(path).name}*")]
        assert others == [Path(path).name], "another name begins with the same letters"


def test_the_keys_hold_the_version(monkeypatch: pytest.MonkeyPatch) -> None:
    from tracker.runs import run as run_module

    before = stage_keys(WHOLE, BOXES, 0)
    monkeypatch.setattr(
        run_module, "numbers_version", lambda stage: "x" if stage == "fusion" else version_of(stage)
    )
    after = stage_keys(WHOLE, BOXES, 0)
    assert {stage for stage in before if before[stage] != after[stage]} == {
        "fusion", "smoothing", "tracks",
    }  # fmt: skip


def test_nothing_is_kept_without_a_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(stage_cache, "bytes_of", forbidden)
    assert compute(WHOLE, BOXES).complete

"""Folders made after public reports, as far as their import goes; skipped where they are absent."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.conftest import DATA
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan, settle

CASES = DATA.parent / "foreign" / "cases"


def _counts(plan: ImportPlan) -> list[int]:
    return [len(view.detections.frames) for view in plan.views if view.detections is not None]


def _found(plan: ImportPlan, name: str) -> str:
    return " ".join(words for what, words in plan.found if what == name)


def _people(plan: ImportPlan) -> int:
    return 0 if plan.truth is None else len(np.unique(plan.truth.ids))


HOLD: dict[str, Callable[[ImportPlan], bool]] = {
    "boxes-of-larger-pictures": lambda plan: plan.views[0].camera.image_size[0] == 1920,
    "comma-yolo": lambda plan: _counts(plan) == [118, 117, 115, 116],
    "camera-without-pose": lambda plan: (
        [view.camera.name for view in plan.views] == ["cam1", "cam2", "cam4"]
        and any("cam3: no pose" in told for told in plan.told)
        and not any("belongs to no camera" in told for told in plan.told)
    ),
    "coco-frame-step": lambda plan: (
        any("taken for the number of the frame" in told for told in plan.told)
        and not _found(plan, "matching")
        and all(view.looked_at is not None and view.looked_at[1] == 5 for view in plan.views)
    ),
    "dropped-frames": lambda plan: any(
        "cam2: it lost about 25 frames (1.00 s) before its frame 150 (6.0 s)" in told
        for told in plan.told
    ),
    "every-second-frame": lambda plan: all(
        view.looked_at is not None and (view.looked_at % 2 == 0).all() for view in plan.views
    ),
    "grid-truth": lambda plan: "MultiviewX so that 100 %" in _found(plan, "truth"),
    "mirrored-world": lambda plan: "left-handed" in _found(plan, "mirrored"),
    "mot-labels": lambda plan: (
        _counts(plan) == [300] * 4
        and [told[-9:] for told in plan.told] == ["(200 car)"]
        and all(f"cam{number}/gt/gt.txt" in plan.told[0] for number in range(1, 5))
    ),
    "mot-none-counts": lambda plan: min(_counts(plan)) > 220,
    "nan-people": lambda plan: min(_counts(plan)) > 110,
    "sparse-truth": lambda plan: (
        plan.truth is not None
        and plan.truth.known is not None
        and np.flatnonzero(plan.truth.known).tolist() == list(range(0, 100, 5))
    ),
    "trc-of-several": lambda plan: _people(plan) == 3,
    "truth-elsewhere": lambda plan: "0 % of its places lie in boxes" in _found(plan, "truth"),
}


@pytest.mark.parametrize("case", HOLD)
def test_a_reported_fault_is_mended_or_reported(case: str) -> None:
    if not CASES.is_dir():
        pytest.skip(f"the reported cases are not there: no folder {CASES}")
    assert HOLD[case](settle(gather([CASES / case / "recording"]), ImportOptions(fps=25.0)))

"""Corrections after other values and methods: they hold, or say why not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.runs.test_corrected_runs import place, run_of, with_a_gap
from tracker.corrections.kinds import make
from tracker.corrections.outcomes import supporting_corrections
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline

SLIDERS = tuple(
    key
    for key, parameter in PARAMETERS.items()
    if parameter.kind == "float" and key.startswith(("fusion.", "smoothing."))
)


@pytest.mark.full
def test_nine_of_ten_hold_after_five_sliders_at_random() -> None:
    whole = with_a_gap()
    before = run_of(whole)
    told = (
        make(kind="same", places=[place(before, 20, 0.5), place(before, 70, 0.6)]),
        make(kind="different", places=[place(before, 40, -0.7), place(before, 41, -0.7)]),
        make(kind="here", places=[[45, 0.13, 0.65, 1.0]]),
        make(kind="name", places=[place(before, 72, 0.6)], name="Anna"),
    )
    rng = np.random.default_rng(5)
    met, all_of_them = 0, 0
    for _ in range(12):
        changes = {}
        for key in rng.choice(SLIDERS, 5, replace=False).tolist():
            parameter = PARAMETERS[key]
            low, high, now = parameter.minimum, parameter.maximum, parameter.default
            assert low is not None
            assert high is not None
            # as somebody tunes: by up to a half, within the range
            changes[key] = float(np.clip(now * rng.uniform(0.5, 1.5), low, high))
        parameters = with_values(RunParameters(single_view="none"), changes)
        run = pipeline.compute(whole, parameters, corrections=told)
        assert [one.id for one in run.outcomes] == [one.id for one in told], "none is dropped"
        assert all(one.met or one.why for one in run.outcomes)
        met += sum(one.met for one in run.outcomes)
        all_of_them += len(told)
    assert met >= 0.9 * all_of_them, f"{met} of {all_of_them}"


def test_rows_that_rest_on_a_correction_name_it() -> None:
    whole = with_a_gap()
    before = run_of(whole)
    same = make(kind="same", places=[place(before, 20, 0.5), place(before, 70, 0.6)])
    here = make(kind="here", places=[[45, 0.13, 0.65, 1.0]])
    lost = make(kind="same", places=[[3, 90.0, 0.0, 1.0], [9, 90.0, 0.0, 1.0]])
    run = run_of(whole, (same, here, lost))
    tracks = run.tracks
    found = supporting_corrections(tracks.frames, tracks.ids, run.corrections, run.outcomes)
    assert set(found) == {"", same.id, here.id}
    own = [
        step for step, name in zip(tracks.frames.tolist(), found, strict=True) if name == same.id
    ]
    assert own == list(range(60, 80)), "from where the other piece begins"
    assert [s for s, n in zip(tracks.frames.tolist(), found, strict=True) if n == here.id] == [45]

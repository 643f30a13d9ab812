"""What a step of the 3D view costs does not grow with the recording."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable

import pytest
import viser

from app.scene.scene import Scene
from tests.app.scene import scene_case
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence

SECONDS = 60.0
SHORT, LONG = 100, 10_000


@pytest.fixture(scope="module")
def runs() -> dict[int, tuple[Sequence, Run]]:
    """Two recordings of the same room, the second a hundred times as long; their steps repeat."""
    sequences = {frames: scene_case.sequence(4, frames, f"{frames}") for frames in (SHORT, LONG)}
    return {frames: (of, scene_case.run(of)) for frames, of in sequences.items()}


def least(work: Callable[[int], object], steps: range) -> tuple[int, int]:
    """Calls of functions and bytes of memory that the cheapest of some steps takes.

    Both grow where a step looks at all of a recording, and neither with what else the machine does.
    """
    calls, memory = [], []
    for step in steps:
        made = 0

        def count(frame: object, event: str, _: object) -> None:
            nonlocal made
            made += event in ("call", "c_call")

        sys.setprofile(count)
        try:
            work(step)
        finally:
            sys.setprofile(None)
        calls.append(made)
        tracemalloc.start()
        work(step + len(steps))
        memory.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    return min(calls), min(memory)


@pytest.mark.full
@pytest.mark.parametrize("alone", [False, True])
def test_a_drawn_step_costs_the_same_however_long_the_recording(
    server: viser.ViserServer, runs: dict[int, tuple[Sequence, Run]], alone: bool
) -> None:
    costs = {}
    for frames, (of, run) in runs.items():
        server.scene.reset()
        server.gui.reset()
        workbench = scene_case.opened(of, run)
        view = Scene(server, workbench)
        workbench.select(1)
        workbench.set_layers({"others": not alone})
        assert view.wait(SECONDS)
        view._worker.close()  # from here on it is drawn in this thread

        def draw(step: int) -> None:
            workbench.seek(step)  # noqa: B023
            view._draw_step(workbench.snapshot(), run)  # noqa: B023

        half = frames // 2
        costs[frames] = least(draw, range(half, half + 20))
        view.close()
    for short, long in zip(costs[SHORT], costs[LONG], strict=True):
        assert 0 < long < 1.5 * short, costs

"""The computation of a run in a terminal, for every command that needs one."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

from app.command.interruption import between_steps
from app.command.terminal import Bar, say

if TYPE_CHECKING:
    from tracker.corrections import Correction
    from tracker.parameters import Stage
    from tracker.parameters.catalogue import RunParameters
    from tracker.runs.pipeline import Progress, Run
    from tracker.sequences.sequence import Sequence


def compute(
    sequence: Sequence,
    parameters: RunParameters | None = None,
    *,
    seed: int = 0,
    corrections: tuple[Correction, ...] = (),
    cached: bool = True,
    words: str = "tracking",
    stages: set[Stage] | None = None,
) -> Run:
    """Compute a run under a progress bar, once its kernels are compiled.

    Args:
        sequence: The sequence to track.
        parameters: The parameters; None for those that fit the sequence.
        seed: The seed of all randomness.
        corrections: The corrections that the run obeys.
        cached: Whether results of earlier runs are taken up, and new ones stored.
        words: The words before the bar.
        stages: Gets every stage that is computed.

    Raises:
        KeyboardInterrupt: After Ctrl-C, between two steps.
    """
    from app.state.compiling import Compiling
    from tracker.runs import pipeline
    from tracker.runs.stage_cache import StageCache

    def report(_: Run, progress: Progress) -> None:
        if stages is not None:
            stages.add(progress.stage)
        bar.at(progress.done, progress.total)

    with (
        Bar(words, "step") as bar,
        closing(Compiling(say)) as compiling,
        between_steps() as interrupted,
    ):
        bar.at(0, sequence.frames)
        compiling.wait(lambda words: None, interrupted)
        return pipeline.compute(
            sequence,
            parameters or pipeline.default_parameters(sequence),
            seed=seed,
            corrections=corrections,
            cache=StageCache.on_disk() if cached else None,
            on_progress=report,
            cancelled=interrupted,
        )

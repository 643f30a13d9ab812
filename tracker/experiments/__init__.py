"""The claims of the papers, run again: ``multiview-phd experiment NAME``.

One module a claim; its ``EXPERIMENT`` is entered here under its name.
"""

from __future__ import annotations

from tracker.experiments import (
    association,
    cameras,
    cmc,
    corrections,
    fig1,
    fig2,
    fig3,
    jpda,
    methods,
    ppf,
)
from tracker.experiments.laboratory import sequences
from tracker.experiments.laboratory.experiment import (
    Context,
    Experiment,
    Finding,
    RandomRooms,
    Result,
    Unavailable,
    Verdict,
)
from tracker.experiments.rooms import experiment as rooms

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        fig1.EXPERIMENT,
        fig2.EXPERIMENT,
        fig3.EXPERIMENT,
        cameras.EXPERIMENT,
        sequences.EXPERIMENT,
        cmc.EXPERIMENT,
        corrections.EXPERIMENT,
        jpda.EXPERIMENT,
        ppf.EXPERIMENT,
        association.EXPERIMENT,
        methods.EXPERIMENT,
        rooms.EXPERIMENT,
    )
}
"""By name, in the order in which ``--all`` runs them."""

__all__ = [
    "EXPERIMENTS",
    "Context",
    "Experiment",
    "Finding",
    "RandomRooms",
    "Result",
    "Unavailable",
    "Verdict",
]

"""All experiments."""

from __future__ import annotations

from tests.papers.claims import (
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
    uncertainty,
)
from tests.papers.laboratory import sequences
from tests.papers.laboratory.experiment import Experiment
from tests.papers.rooms import experiment as rooms

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
        uncertainty.EXPERIMENT,
    )
}
"""By name, in the order in which ``--all`` runs them."""

"""Evaluation of tracks against ground truth: OSPA, OSPA(2), GOSPA, CLEAR MOT, identity, HOTA, and
the report."""

from tracker.evaluation.difference import Difference, compare
from tracker.evaluation.evaluation import (
    BY_KEY,
    DEFINITIONS,
    Evaluation,
    Pairs,
    Series,
    evaluate,
    evaluate_sequence,
)
from tracker.evaluation.figures import Definition, Figure
from tracker.evaluation.settings import EvaluationSettings

__all__ = [
    "BY_KEY",
    "DEFINITIONS",
    "Definition",
    "Difference",
    "Evaluation",
    "EvaluationSettings",
    "Figure",
    "Pairs",
    "Series",
    "compare",
    "evaluate",
    "evaluate_sequence",
]

"""Evaluation of tracks against ground truth: OSPA, OSPA(2), GOSPA, CLEAR MOT, identity, HOTA, and
the report."""

from tracker.evaluation.difference import Difference, compare
from tracker.evaluation.figures import DEFINITIONS, Definition, Figure
from tracker.evaluation.result import Evaluation, Pairs, Series
from tracker.evaluation.settings import EvaluationSettings
from tracker.evaluation.summary import evaluate, evaluate_sequence

__all__ = [
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

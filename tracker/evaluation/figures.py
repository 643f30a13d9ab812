"""The definition of every figure of an evaluation: name, unit, direction, meaning and source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tracker.evaluation.settings import EvaluationSettings

Direction = Literal["higher", "lower", "zero", "none"]
"""The values that are better: higher, lower, nearer to zero, or none in general."""

SOURCES = {
    "BS08": "Bernardin, Stiefelhagen, EURASIP JIVP 2008 (CLEAR MOT)",
    "LHN09": "Li, Huang, Nevatia, CVPR 2009",
    "RSZCT16": "Ristani et al., ECCV workshops 2016",
    "LODTGLL21": "Luiten et al., IJCV 129, 2021",
    "SVV08": "Schuhmacher, Vo, Vo, IEEE TSP 56(8), 2008",
    "BVV20": "Beard, Vo, Vo, IEEE TSP 68, 2020",
    "RGS17": "Rahmathullah, García-Fernández, Svensson, FUSION 2017",
}
"""The references by their keys."""


@dataclass(frozen=True, slots=True)
class Definition:
    """The definition of one figure."""

    key: str
    """The key of the figure."""
    name: str
    """The name that is displayed."""
    group: str
    """The name of the group of figures in tables."""
    unit: str
    """The unit; ``{d}`` stands for the unit of the distance, ``{d^p}`` for its p-th power in the
    parts of GOSPA."""
    direction: Direction
    """The values that are better."""
    digits: int
    """The number of decimals that are displayed, and in which values are compared."""
    settings: tuple[str, ...]
    """The names of the settings that the value depends on."""
    help: str
    """The definition in words."""
    source: str = ""
    """The key of the reference in :data:`SOURCES`."""
    headline: bool = False
    """Whether short tables show the figure."""

    def unit_for(self, settings: EvaluationSettings) -> str:
        """Return the unit with the chosen distance and order."""
        power = f"^{settings.order:g}" if settings.order != 1.0 and settings.unit else ""
        return self.unit.replace("{d^p}", settings.unit + power).replace("{d}", settings.unit)


_CLEAR = ("distance", "gate")
_OSPA = ("distance", "cutoff", "order")

DEFINITIONS: tuple[Definition, ...] = (
    Definition(
        "mota", "MOTA", "CLEAR", "", "higher", 3, _CLEAR,
        "1 − (misses + false positives + identity switches) / true positions.",
        "BS08", True,
    ),
    Definition(
        "motp", "MOTP", "CLEAR", "{d}", "lower", 3, _CLEAR,
        "Mean distance of the pairs of person and estimate, pairs being kept over time.",
        "BS08",
    ),
    Definition(
        "misses", "Missed", "CLEAR", "", "lower", 0, _CLEAR,
        "True positions without an estimate, over all steps.", "BS08", True,
    ),
    Definition(
        "false_positives", "False", "CLEAR", "", "lower", 0, _CLEAR,
        "Estimates without a person, over all steps.", "BS08", True,
    ),
    Definition(
        "id_switches", "Identity switches", "CLEAR", "", "lower", 0, _CLEAR,
        "How often a person is paired with another id than when last paired.", "BS08", True,
    ),
    Definition(
        "fragmentations", "Fragmentations", "CLEAR", "", "lower", 0, _CLEAR,
        "How often a person's pairing is taken up again after a gap, absence included.", "LHN09",
    ),
    Definition(
        "mostly_tracked", "Mostly tracked", "CLEAR", "people", "higher", 0, _CLEAR,
        "People paired at more than 80 % of their steps.", "LHN09",
    ),
    Definition(
        "partly_tracked", "Partly tracked", "CLEAR", "people", "none", 0, _CLEAR,
        "People paired at 20 to 80 % of their steps.", "LHN09",
    ),
    Definition(
        "mostly_lost", "Mostly lost", "CLEAR", "people", "lower", 0, _CLEAR,
        "People paired at less than 20 % of their steps.", "LHN09",
    ),
    Definition(
        "idf1", "IDF1", "Identity", "", "higher", 3, _CLEAR,
        "Share of positions that carry the right identity, when each person gets the one "
        "track that fits best: 2 IDTP / (estimates + true positions).", "RSZCT16", True,
    ),
    Definition(
        "idp", "IDP", "Identity", "", "higher", 3, _CLEAR,
        "Identity precision: share of the estimates that carry the right identity.", "RSZCT16",
    ),
    Definition(
        "idr", "IDR", "Identity", "", "higher", 3, _CLEAR,
        "Identity recall: share of the true positions found under the right identity.", "RSZCT16",
    ),
    Definition(
        "hota", "HOTA", "HOTA", "", "higher", 3, _CLEAR,
        "√(DetA · AssA), mean over α = 0.05 … 0.95; similarity = 1 − distance / gate.",
        "LODTGLL21", True,
    ),
    Definition(
        "deta", "DetA", "HOTA", "", "higher", 3, _CLEAR,
        "Detection: TP / (TP + missed + false), mean over α.", "LODTGLL21",
    ),
    Definition(
        "assa", "AssA", "HOTA", "", "higher", 3, _CLEAR,
        "Association: how much of its person's and its track's life each pair's two ids share, "
        "mean over the pairs and α.", "LODTGLL21",
    ),
    Definition(
        "loca", "LocA", "HOTA", "", "higher", 3, _CLEAR,
        "Localisation: mean similarity of the pairs, mean over α.", "LODTGLL21",
    ),
    Definition(
        "ospa", "OSPA", "OSPA", "{d}", "lower", 3, _OSPA,
        "Distance between the set of people and the set of estimates, mean over the steps.",
        "SVV08", True,
    ),
    Definition(
        "ospa_localisation", "OSPA, localisation", "OSPA", "{d}", "lower", 3, _OSPA,
        "The part of OSPA that is due to positions, mean over the steps.", "SVV08",
    ),
    Definition(
        "ospa_cardinality", "OSPA, cardinality", "OSPA", "{d}", "lower", 3, _OSPA,
        "The part of OSPA that is due to the number of people, mean over the steps.", "SVV08",
    ),
    Definition(
        "ospa2", "OSPA(2)", "OSPA", "{d}", "lower", 3, (*_OSPA, "window"),
        "OSPA between the sets of tracks over a window that ends at each step, mean over the "
        "steps: it also sees changed identities.", "BVV20",
    ),
    Definition(
        "ospa2_whole", "OSPA(2), whole sequence", "OSPA", "{d}", "lower", 3, _OSPA,
        "OSPA between the sets of tracks, the window being the whole sequence.", "BVV20",
    ),
    Definition(
        "gospa", "GOSPA", "GOSPA", "{d}", "lower", 3, _OSPA,
        "Localisation, missed and false targets in one cost (α = 2), not divided by the number "
        "of people, mean over the steps.", "RGS17",
    ),
    Definition(
        "gospa_localisation", "GOSPA, localisation", "GOSPA", "{d^p}", "lower", 3, _OSPA,
        "Σ d^p over the pairs, mean over the steps.", "RGS17",
    ),
    Definition(
        "gospa_missed", "GOSPA, missed", "GOSPA", "{d^p}", "lower", 3, _OSPA,
        "c^p / 2 for each missed person, mean over the steps.", "RGS17",
    ),
    Definition(
        "gospa_false", "GOSPA, false", "GOSPA", "{d^p}", "lower", 3, _OSPA,
        "c^p / 2 for each false estimate, mean over the steps.", "RGS17",
    ),
    Definition(
        "position_error", "Position error", "Positions", "m", "lower", 3, _CLEAR,
        "Mean distance of the pairs, each step paired by itself.", "", True,
    ),
    Definition(
        "position_error_95", "Position error, 95 %", "Positions", "m", "lower", 3, _CLEAR,
        "95 of 100 pairs are nearer than this.",
    ),
    Definition(
        "found_share", "Found", "Positions", "", "higher", 3, ("near",),
        "Share of the true positions that have an estimate of their own so near.",
    ),
    Definition(
        "false_per_step", "False a step", "Positions", "1/step", "lower", 3, ("near",),
        "Estimates a step without a true position of their own so near.",
    ),
    Definition(
        "cardinality_error", "Cardinality error", "Positions", "people", "lower", 3, (),
        "Mean of |estimates − people| over the steps.",
    ),
    Definition(
        "cardinality_bias", "Cardinality bias", "Positions", "people", "zero", 3, (),
        "Mean of estimates − people over the steps: above 0 there are too many.",
    ),
    Definition(
        "pixel_error", "Pixel error", "Pictures", "px", "lower", 2, ("overlap",),
        "Mean distance of the centres of reprojected and true boxes, all cameras together.",
    ),
    Definition(
        "pixel_overlap", "Box overlap", "Pictures", "", "higher", 3, ("overlap",),
        "Mean intersection over union of the paired boxes, all cameras together.",
    ),
    Definition(
        "pixel_found", "Boxes found", "Pictures", "", "higher", 3, ("overlap",),
        "Share of the true boxes in the pictures that have a pair, all cameras together.",
    ),
)  # fmt: skip

BY_KEY = {definition.key: definition for definition in DEFINITIONS}
"""All definitions by key, in the order of the tables."""


@dataclass(frozen=True, slots=True)
class Figure:
    """The value of one figure, and the settings it was measured with."""

    definition: Definition
    """The definition of the figure."""
    value: float | int | None
    """The value; None where it is undefined (see the function that computes it)."""
    unit: str
    """The unit of the value; empty for a figure without unit."""
    measured_with: str
    """The settings that the value depends on, such as gate, cut-off, order and window, in words."""

    @property
    def text(self) -> str:
        """The value as tables display it, without unit; an en dash where undefined."""
        return number(self.value, self.definition.digits)


def number(value: float | int | None, digits: int, *, sign: bool = False) -> str:
    """Format a value with fixed decimals and a typographic minus; None becomes an en dash.

    Args:
        value: The value, or None.
        digits: The number of decimals.
        sign: Whether a positive value gets a plus.
    """
    if value is None:
        return "–"
    rounded = round(float(value), digits) + 0.0  # −0.0 + 0.0 is 0.0
    return f"{rounded:{'+' if sign and rounded else ''}.{digits}f}".replace("-", "−")

"""The settings of the evaluation: distance, gate, cut-off, order, window."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from tracker.parameters import Params

Distance = Literal["position", "ground", "box"]

DISTANCE_WORDS: dict[Distance, str] = {
    "position": "3D distance",
    "ground": "ground-plane distance",
    "box": "3D-box (1 − GIoU)/2",
}
"""The name of each distance that is displayed beside a figure."""


def _ui(symbol: str, unit: str = "", *, log: bool = False) -> Any:
    return Field(json_schema_extra={"x-ui": {"symbol": symbol, "unit": unit, "log": log}})


class EvaluationSettings(Params):
    """Settings of the evaluation. They change how a run is scored, not the run."""

    # The gate of 1 m is that of MOTChallenge's 3D benchmark (Leal-Taixé et al., arXiv:1504.01942);
    # the cut-off equals it, so that OSPA and CLEAR take the same people for missed. An overlap of
    # 1/2 is that of PASCAL VOC (Everingham et al., IJCV 88, 2010). The nearness of 0.3 m, about
    # the half width of a person, and the window of 10 steps are conventions of this program.

    distance: Annotated[Distance, _ui("d")] = "position"
    """Distance between an estimate and a true position: in 3D, on the floor, or of their boxes."""

    gate: Annotated[float, Field(ge=0.01, le=100.0), _ui("d_g", "m", log=True)] = 1.0
    """An estimate farther than this from a person is not paired (3D and ground-plane distance)."""

    box_gate: Annotated[float, Field(ge=0.01, le=1.0), _ui("b_g")] = 0.5
    """The gate where boxes are compared: (1 − GIoU)/2, which is 0.5 where two boxes touch."""

    cutoff: Annotated[float, Field(ge=0.01, le=1000.0), _ui("c", "m", log=True)] = 1.0
    """The cost of a missed or false target in OSPA, OSPA(2) and GOSPA; without unit for boxes."""

    order: Annotated[float, Field(ge=1.0, le=10.0), _ui("p")] = 1.0
    """Order of OSPA, OSPA(2) and GOSPA: the higher, the more outliers count."""

    window: Annotated[int, Field(ge=1, le=100_000), _ui("w", "steps", log=True)] = 10
    """Steps that OSPA(2) looks back over, the present one included."""

    near: Annotated[float, Field(ge=0.01, le=10.0), _ui("d_n", "m", log=True)] = 0.3
    """A true position counts as found where an estimate lies within this."""

    overlap: Annotated[float, Field(ge=0.05, le=0.95), _ui("IoU")] = 0.5
    """Intersection over union from which two boxes in a picture are one person's."""

    @property
    def effective_gate(self) -> float:
        """The gate of the chosen distance."""
        return self.box_gate if self.distance == "box" else self.gate

    @property
    def unit(self) -> str:
        """The unit of the chosen distance; empty for the box distance."""
        return "" if self.distance == "box" else "m"

    def in_words(self, names: tuple[str, ...]) -> str:
        """Describe some of the settings in words, for display beside a figure.

        Args:
            names: The fields to describe; ``gate`` is the effective gate.
        """
        unit = f" {self.unit}" if self.unit else ""
        words = {
            "distance": DISTANCE_WORDS[self.distance],
            "gate": f"gate {self.effective_gate:g}{unit}",
            "cutoff": f"cut-off {self.cutoff:g}{unit}",
            "order": f"order {self.order:g}",
            "window": f"window {self.window} step{'s' if self.window != 1 else ''}",
            "near": f"within {self.near:g} m",
            "overlap": f"IoU ≥ {self.overlap:g}",
        }
        return ", ".join(words[name] for name in names)

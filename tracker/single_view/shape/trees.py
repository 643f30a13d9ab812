"""The boosted trees that classify windows of an image as a person or background.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
[BB05] Bourdev, Brandt, "Robust object detection via soft cascade", CVPR 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int32
from numpy import ndarray

from tracker.kernels.pictures.channels import tree_scores

FILE = Path(__file__).parent / "trees.npz"


@dataclass(frozen=True, slots=True, eq=False)
class Trees:
    """T trees of depth 3 over the means of channels in the cells of a window ([DTPB09]_).

    Their sum is the log odds of a person, with the prior of the training set. A window is
    rejected as soon as the sum is lower than that of nearly any person of the training set
    ([BB05]_).
    """

    features: Int32[ndarray, "T 7"]
    """Feature of each node, breadth first."""
    thresholds: Int32[ndarray, "T 7"]
    """Threshold of each node."""
    leaves: Float32[ndarray, "T 8"]
    """Score of each leaf."""
    least: Float32[ndarray, " T"]
    """Sum after each tree below which a window is rejected."""

    @staticmethod
    @cache
    def read() -> Trees:
        """Read the trees that come with the program."""
        with np.load(FILE) as file:
            return Trees(file["features"], file["thresholds"], file["leaves"], file["least"])

    def write(self, path: Path) -> None:
        """Write the trees to a file."""
        np.savez_compressed(
            path,
            features=self.features,
            thresholds=self.thresholds,
            leaves=self.leaves,
            least=self.least,
        )

    def scores(
        self, sums: Int32[ndarray, "h1 w1 C"], edges: Float[ndarray, "N 4"]
    ) -> Float32[ndarray, " N"]:
        """Compute the log odds of windows; minus infinity for rejected ones.

        Args:
            sums: Integral images of the channels.
            edges: Left, top, right and bottom of N windows, pixels.
        """
        found: Float32[ndarray, " N"] = tree_scores(
            sums, edges, self.features, self.thresholds, self.leaves, self.least
        )
        return found

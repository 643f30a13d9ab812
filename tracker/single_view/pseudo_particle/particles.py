"""Boxes as particles with colour likelihoods: motion, search for new targets, and weights."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.parameters.groups.colour_phd import ColourBoxParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.appearance import Appearance, Scene
from tracker.single_view.noise import box_sigmas
from tracker.single_view.pictures import particles as particle_set


class ColourParticles:
    """The models that the pseudo particle filter and the classical one share.

    Motion: a random walk in half sizes. Weight: exp(-λ d), d the Bhattacharyya distance
    between the particle's histogram and the nearest of all targets' colours, times the
    likelihood of the foreground in the box.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: PseudoParticleParams,
        colours: ColourBoxParams,
        foreground: ForegroundParams,
        reader: Pictures,
    ) -> None:
        """Read the templates and learn the background, where it is used.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters, self._colours = parameters, colours
        self._appearance = Appearance(
            sequence,
            camera_index,
            reader,
            colour_space=colours.colour_space,
            histogram_kernel=colours.histogram_kernel,
            size_jitter=colours.size_jitter,
            foreground=foreground if parameters.asks_foreground(colours) else None,
        )
        self._root_time = float(np.sqrt(sequence.step_time))
        self.persons = len(self._appearance.model.names)

    def start(self) -> Any:
        """The state of the foreground model before the first image."""
        return self._appearance.start()

    def prepare(self, state: Any, picture: UInt8[ndarray, "h w 3"]) -> tuple[Any, Scene]:
        """Prepare an image: :meth:`tracker.single_view.colour.appearance.Appearance.prepare`."""
        return self._appearance.prepare(state, picture)

    def move(
        self, particles: Float[ndarray, "S 4"], rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Predict by a random walk in half sizes; width and height change together.

            x ← x + σ_w √T H n,  H ← H exp(σ_H √T n₃)

        with the time T of a step and standard normal n.

        Args:
            particles: Centre and half sizes of S particles, pixels.
            rng: The generator of n.

        Returns:
            At most S particles: those whose centres are still in the image.
        """
        p, root = self._colours, self._root_time
        noise = rng.standard_normal((len(particles), 3))
        moved = particles.copy()
        moved[:, :2] += p.motion_sigma * root * particles[:, 2:] * noise[:, :2]
        moved[:, 2:] *= np.exp(p.growth_sigma * root * noise[:, 2:])
        return self._appearance.within(moved)

    def draw_new(self, count: int, scene: Scene, rng: np.random.Generator) -> Float[ndarray, "N 4"]:
        """Draw particles where new targets may be: on the foreground, or anywhere.

        Args:
            count: Number of particles; fewer result where no target can be.
            scene: The image.
            rng: The generator of places and sizes.
        """
        if self._parameters.birth == "foreground":
            drawn = self._appearance.draw_on_foreground(count, scene, rng)
        else:
            drawn = self._appearance.draw_anywhere(count, rng)
        return self._appearance.within(drawn)

    def evidence(
        self, scene: Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
        """Compute the foreground's log factors of the likelihood of boxes, and shares inside.

        Args:
            scene: The image.
            boxes: Centre and half sizes of N boxes, pixels.

        Returns:
            As :func:`tracker.single_view.pictures.foreground.shape_scores`.
        """
        p = self._colours
        return self._appearance.shape_scores(
            scene, boxes, inside_weight=p.foreground_weight, around_weight=p.surroundings_weight
        )

    def scores(
        self, scene: Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, " N"], Int[ndarray, " N"]]:
        """Compute the log weight -λ d of each box, plus that of its foreground.

        Args:
            scene: The image.
            boxes: Centre and half sizes of N boxes, pixels.

        Returns:
            The log weights, and the index of the person whose colours each box fits best.
        """
        distances = self._appearance.distances(scene, boxes)
        colours = particle_set.log_likelihoods(distances, self._parameters.sharpness)
        evidence, _ = self.evidence(scene, boxes)
        return np.asarray(colours + evidence), np.asarray(distances.argmin(axis=1))

    def distances(self, scene: Scene, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N G"]:
        """Compute the Bhattacharyya distance d of each of N boxes to each of G people's colours."""
        return self._appearance.distances(scene, boxes)

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Standard deviations of modes: proportional to the box."""
        p = self._colours
        return box_sigmas(boxes, p.centre_sigma, p.size_sigma)

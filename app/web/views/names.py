"""Whose name a track has: by the colours of the boxes that fed it, among people with templates."""

from __future__ import annotations

import numpy as np

from tracker.runs.pipeline import Run

SURE = 0.6
"""Mean probability from which on a track has a name: less is anybody's."""


class Names:
    """Sums up a run's likenesses, a step once. Not thread-safe."""

    def __init__(self) -> None:
        self._sums: dict[int, np.ndarray] = {}
        self._done = 0

    def told(self, run: Run) -> dict[int, str]:
        """The name of each track that has one, as far as the run is computed.

        The mean over the boxes that fed a track of the probability that their colours are those
        of each person, each with the share that the box had in the track.

        Args:
            run: Always of the same tracks, of which each step is looked at once. The templates of
                its own recording name the people: the open one may have others by now.
        """
        people = list(dict.fromkeys(template.name for template in run.sequence.templates))
        done = min(run.done, len(run.fused), len(run.views))
        if len(people) < 2:
            return {}
        for step in range(self._done, done):
            fused, tracks = run.fused[step], run.tracks
            rows = tracks.at(step)
            for camera, view in enumerate(run.views[step]):
                if view.likenesses.shape[1] != len(people):
                    continue
                for track, component in zip(
                    tracks.ids[rows].tolist(), tracks.components[rows].tolist(), strict=True
                ):
                    if component < 0:  # whom the smoothing alone found
                        continue
                    source = int(fused.sources[camera, component])
                    if 0 <= source < len(view.likenesses):
                        share = float(fused.source_weights[camera, component])
                        row = np.append(view.likenesses[source], 1.0) * share
                        self._sums[track] = self._sums.get(track, 0.0) + row
        self._done = done
        means = {track: row[:-1] / max(row[-1], 1e-12) for track, row in self._sums.items()}
        return {
            track: people[int(mean.argmax())] for track, mean in means.items() if mean.max() >= SURE
        }

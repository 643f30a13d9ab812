"""The evaluation of each person and of each track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tracker.evaluation.clear import Clear, PersonStatus
from tracker.evaluation.figures import mean, percentile_95
from tracker.evaluation.identity import Identity
from tracker.evaluation.matching import Comparison
from tracker.evaluation.positions import Positions

TrackKind = Literal["person", "false", "don't care"]


@dataclass(frozen=True, slots=True)
class PersonRow:
    """The scores of one person of the truth; only steps with a certain position count."""

    id: int
    """The id of the person."""
    first: int
    """The first step of the person."""
    last: int
    """The last step of the person, included."""
    steps: int
    """The number of steps at which the person is present."""
    tracked: int
    """The number of steps at which the person is paired."""
    status: PersonStatus
    """How much of the person's steps are tracked."""
    found_share: float
    """Share of the steps at which an estimate within the near distance is paired with the
    person."""
    error: float | None
    """Mean position error, metres; None without pairs."""
    error_95: float | None
    """95th percentile of the position error, metres; None without pairs."""
    switches: int
    """The number of identity switches."""
    fragmentations: int
    """The number of interruptions between tracked steps."""
    track: int | None
    """The track that is assigned to the person in the identity figures, if any."""


@dataclass(frozen=True, slots=True)
class TrackRow:
    """The scores of one track; steps that matched a don't-care position do not count."""

    id: int
    """The id of the track."""
    first: int
    """The first step of the track."""
    last: int
    """The last step of the track, included."""
    steps: int
    """The number of steps at which the track is reported."""
    ignored: int
    """The number of steps at which the track matched a don't-care position."""
    matched: int
    """The number of steps at which the track is paired."""
    kind: TrackKind
    """``false`` where the track is paired at fewer than half of the steps that count."""
    person: int | None
    """The person with whom the track is paired most often (of equals the lowest id), if any."""
    person_share: float | None
    """Share of the steps that count at which the track is paired with that person."""
    error: float | None
    """Mean distance of all pairs of the track, in the unit of the distance; None without pairs."""


def person_rows(
    comparison: Comparison, clear: Clear, identity: Identity, positions: Positions
) -> tuple[PersonRow, ...]:
    """Return the scores of all people of the truth, by id."""
    truth, tracks, statuses = comparison.truth, comparison.tracks, clear.statuses
    rows = []
    for k, name in enumerate(truth.names.tolist()):
        frames = truth.frames[truth.indices == k]
        errors = positions.by_person[k]
        errors = errors[np.isfinite(errors)]
        own = int(identity.track_of[k])
        rows.append(
            PersonRow(
                id=name,
                first=int(frames[0]),
                last=int(frames[-1]),
                steps=len(frames),
                tracked=int(clear.tracked[k]),
                status=statuses[k],
                found_share=float(positions.found_by_person[k]) / len(frames),
                error=mean(errors),
                error_95=percentile_95(errors),
                switches=int(clear.switches[k]),
                fragmentations=int(clear.fragmentations[k]),
                track=int(tracks.names[own]) if own >= 0 else None,
            )
        )
    return tuple(rows)


def track_rows(comparison: Comparison, clear: Clear) -> tuple[TrackRow, ...]:
    """Return the scores of all tracks, by id, including those whose every step is ignored."""
    truth, tracks, ignored = comparison.truth, comparison.tracks, comparison.ignored
    names = np.union1d(tracks.names, ignored.names)
    frames = np.concatenate([tracks.frames, ignored.frames])
    owner = np.searchsorted(names, np.concatenate([tracks.ids, ignored.ids]))
    paired = np.searchsorted(names, tracks.ids[clear.matches.track_rows])
    together = np.zeros((len(names), max(len(truth.names), 1)), dtype=np.int64)
    np.add.at(together, (paired, truth.indices[clear.matches.truth_rows]), 1)
    distances = np.bincount(paired, weights=clear.distances, minlength=len(names)).tolist()
    rows = []
    for k, name in enumerate(names.tolist()):
        reported = frames[owner == k]
        set_aside = int((ignored.ids == name).sum())
        counted, matched = len(reported) - set_aside, int(together[k].sum())
        best = int(together[k].argmax())
        kind: TrackKind = "person" if 2 * matched >= counted else "false"
        rows.append(
            TrackRow(
                id=name,
                first=int(reported.min()),
                last=int(reported.max()),
                steps=len(reported),
                ignored=set_aside,
                matched=matched,
                kind=kind if counted else "don't care",
                person=int(truth.names[best]) if matched else None,
                person_share=int(together[k, best]) / counted if matched else None,
                error=distances[k] / matched if matched else None,
            )
        )
    return tuple(rows)

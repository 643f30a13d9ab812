"""The evaluation of each person and of each track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy import ndarray

from tracker.evaluation.measures.clear import Clear
from tracker.evaluation.measures.identity import Identity
from tracker.evaluation.measures.matching import Comparison
from tracker.evaluation.positions import Positions

PersonStatus = Literal["mostly tracked", "partly tracked", "mostly lost"]
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
    truth, tracks = comparison.truth, comparison.tracks
    rows = []
    for k, name in enumerate(truth.names.tolist()):
        frames = truth.frames[truth.indices == k]
        errors = positions.by_person[k]
        errors = errors[np.isfinite(errors)]
        share = clear.tracked[k] / clear.present[k]
        status: PersonStatus = (
            "mostly tracked" if share > 0.8 else "mostly lost" if share < 0.2 else "partly tracked"
        )
        own = int(identity.track_of[k])
        rows.append(
            PersonRow(
                id=name,
                first=int(frames[0]),
                last=int(frames[-1]),
                steps=len(frames),
                tracked=int(clear.tracked[k]),
                status=status,
                found_share=float(positions.found[k]) / len(frames),
                error=float(errors.mean()) if len(errors) else None,
                error_95=float(np.percentile(errors, 95)) if len(errors) else None,
                switches=int(clear.switches[k]),
                fragmentations=int(clear.fragmentations[k]),
                track=int(tracks.names[own]) if own >= 0 else None,
            )
        )
    return tuple(rows)


def track_rows(comparison: Comparison, clear: Clear) -> tuple[TrackRow, ...]:
    """Return the scores of all tracks, by id, including those whose every step is ignored."""
    truth, tracks, ignored = comparison.truth, comparison.tracks, comparison.ignored
    matches = clear.matches
    apart = comparison.measure.between(
        truth.positions[matches.truth_rows], tracks.positions[matches.track_rows]
    )
    names = np.union1d(tracks.names, ignored.names)
    frames = np.concatenate([tracks.frames, ignored.frames])
    owner = np.searchsorted(names, np.concatenate([tracks.ids, ignored.ids]))
    first = np.full(len(names), np.iinfo(np.int64).max)
    last = np.full(len(names), -1)
    np.minimum.at(first, owner, frames)
    np.maximum.at(last, owner, frames)
    reported = np.bincount(owner, minlength=len(names))
    set_aside = np.bincount(np.searchsorted(names, ignored.ids), minlength=len(names))
    paired = np.searchsorted(names, tracks.ids[matches.track_rows])
    together = np.zeros((len(names), max(len(truth.names), 1)), dtype=np.int64)
    np.add.at(together, (paired, truth.indices[matches.truth_rows]), 1)
    distance = np.bincount(paired, weights=apart, minlength=len(names))
    return tuple(
        _track_row(
            int(name), (int(first[k]), int(last[k])), int(reported[k]), int(set_aside[k]),
            together[k], float(distance[k]), truth.names,
        )
        for k, name in enumerate(names)
    )  # fmt: skip


def _track_row(
    name: int,
    life: tuple[int, int],
    reported: int,
    ignored: int,
    together: ndarray,
    distance: float,
    people: ndarray,
) -> TrackRow:
    """Return the scores of one track.

    Args:
        name: The id of the track.
        life: The first and the last step of the track.
        reported: The number of steps at which the track is reported.
        ignored: The number of these steps that do not count.
        together: The number of steps at which the track is paired with each person.
        distance: The sum of the distances of all pairs.
        people: The ids of the people.
    """
    counted, matched = reported - ignored, int(together.sum())
    best = int(together.argmax())
    kind: TrackKind = "person" if 2 * matched >= counted else "false"
    return TrackRow(
        id=name,
        first=life[0],
        last=life[1],
        steps=reported,
        ignored=ignored,
        matched=matched,
        kind=kind if counted else "don't care",
        person=int(people[best]) if matched else None,
        person_share=int(together[best]) / counted if matched else None,
        error=distance / matched if matched else None,
    )

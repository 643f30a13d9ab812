"""A run over time, summed up for the part and the width that somebody looks at.

However long a recording is, a page gets a bounded number of values a curve: the lowest,
the highest and the mean of as many steps as share one place of its axis.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from app.messages import Model
from app.state.pairs import alike
from app.state.scores import Scored
from tracker import smoothing
from tracker.fusion.trajectories import Trajectories
from tracker.runs.run import Run, given_names
from tracker.sequences.sequence import Sequence
from tracker.smoothing import Decision

Span = tuple[int, int, Literal["seen", "coasting", "long miss"]]
"""First step, last step, and whether any camera saw the target; a long miss is coasting too."""

LaneEvent = tuple[int, int, Literal["birth", "death", "long miss", "cut", "joined", "removed"]]
"""Step, track and what happened to it; the last three by smoothing."""


class TrackLife(Model):
    """A track's life."""

    id: int
    name: str | None = None
    """What somebody said, or whose colours it has, among people with templates."""
    first: int
    last: int
    """Of its whole life."""
    seen: float
    """Share of its whole life in which a camera saw it."""
    cameras: list[float]
    """The same share for each camera by itself."""
    spans: list[Span]
    """Within the steps asked for; ones shorter than ``stride`` are joined with their neighbours."""


class Counts(Model):
    """Whole numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[int]
    high: list[int]
    mean: list[float]


class Numbers(Model):
    """Numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[float]
    high: list[float]
    mean: list[float]


class PinnedLife(TrackLife):
    """A track of the pinned run."""

    like: int | None
    """The track of the shown run that it is most often paired with."""


class PinnedTimeline(Model):
    """The pinned run, in the same buckets."""

    run: str
    count: Counts
    tracks: list[PinnedLife]


class Decided(Model):
    """What smoothing made otherwise than the filter, and why."""

    step: int
    track: int
    kind: Literal["cut", "joined", "removed"]
    words: str


class Timeline(Model):
    """The shown run over time, as far as it is computed, summed up in buckets of steps."""

    run: str
    done: int
    frames: int
    first: int
    """The first step of the first bucket."""
    stride: int
    """Steps a bucket: 1 where each step has its own value."""
    cardinality: Numbers
    """Expected number of people."""
    deviation: Numbers
    """Its standard deviation."""
    count: Counts
    """Targets reported."""
    truth: Counts | None
    """People really there, over all steps asked for."""
    tracks: list[TrackLife]
    """Those that live in the steps asked for, by id."""
    pinned: PinnedTimeline | None
    """Where a run is pinned that is not the shown one."""
    events: list[LaneEvent]
    """Of all steps, also of those not asked for, in their order."""
    decisions: list[Decided]
    """What smoothing changed, by its step; empty for the filter alone."""
    left_out: int
    """How many more live there: the shorter ones, where they are very many."""


@dataclass(frozen=True, slots=True)
class Named:
    """A decision, with the ids of those whom it is about."""

    step: int
    track: int
    other: int | None
    """Whom it was joined to, or what was cut off; None where that has no id."""
    decision: Decision

    @property
    def words(self) -> str:
        """What was decided and why: "joined to 3 at 264: one person, 0.97 against 0.02"."""
        one = self.decision
        joined = one.kind == "joined" and self.other not in (None, self.track)
        whom = f" to {self.other}" if joined else ""
        odds = f"{one.probability:.2f} against {one.against:.2f}"
        return f"{one.kind}{whom} at {self.step}: {one.reason}, {odds}"


def decided(run: Run) -> list[Named]:
    """What was decided of every track that has an id; those of the filter alone are named by the
    filter's."""
    run = run.snapshot()
    if run.smoothed is None or run.tracks is run.filtered:
        return []
    names = dict(zip(run.filtered.labels.tolist(), run.filtered.ids.tolist(), strict=True))
    names |= smoothing.names_of(run.smoothed, run.tracks)
    return [
        Named(one.step, names[one.label], names.get(one.other), one)
        for one in run.smoothed.decisions
        if one.label in names
    ]


def words_of(run: Run) -> dict[tuple[int, int, str], str]:
    """Why, of each decision by step, id and kind."""
    return {(one.step, one.track, one.decision.kind): one.words for one in decided(run)}


SURE = 0.6
"""Mean probability from which on a track has a name: less is anybody's."""


class Names:
    """Sums up a run's likenesses, a step once. Not thread-safe."""

    def __init__(self) -> None:
        self._sums: dict[int, np.ndarray] = {}
        self._done = 0

    def by_track(self, run: Run) -> dict[int, str]:
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


BUCKETS = 4096
"""Values a curve at most, where nobody asks for fewer: more than a wide screen has pixels."""

MOST_TRACKS = 400
"""Lanes told at once; the rest is a number."""


MOST_EVENTS = 4000
"""Events told at most: the first ones."""

LONG_MISS = 1.5
"""Seconds without a box from any camera that make a miss long."""


@dataclass(frozen=True, slots=True)
class Window:
    """A part of the steps, cut into buckets of equal size."""

    first: int
    """The first step of the first bucket, a multiple of :attr:`stride`."""
    end: int
    """One past the last step."""
    stride: int
    """Steps a bucket; the last may have fewer."""

    @staticmethod
    def of(frames: int, first: int = 0, last: int | None = None, buckets: int = BUCKETS) -> Window:
        """The buckets of the steps ``first`` … ``last``, cut off at the sequence's end.

        Buckets begin at multiples of their size, so that a view that moves sideways shows
        the same values again.
        """
        end = frames if last is None else max(0, min(last + 1, frames))
        first = max(0, min(first, end))
        stride = max(1, -(-(end - first) // buckets))
        while (end - first // stride * stride) > buckets * stride:
            stride += 1  # beginning inside a bucket takes one bucket more
        return Window(first // stride * stride, end, stride)

    def starts(self, done: int) -> Int[ndarray, " B"]:
        """The first step of each bucket that holds one of the first ``done`` steps."""
        return np.arange(self.first, max(self.first, min(self.end, done)), self.stride)

    def worst(self, values: Float[ndarray, " S"]) -> Int[ndarray, " B"]:
        """The step with the greatest value of each bucket; not a number counts as least."""
        starts = self.starts(len(values))
        if self.stride == 1:
            return starts
        padded = np.full(len(starts) * self.stride, -np.inf)
        known = np.nan_to_num(values[self.first : self.end], nan=-np.inf)
        padded[: len(known)] = known
        worst: ndarray = starts + padded.reshape(-1, self.stride).argmax(axis=1)
        return worst


def counts(values: Int[ndarray, " S"], window: Window) -> Counts:
    """Whole numbers over time."""
    low, high, mean = _summary(values, window)
    return Counts(low=low.tolist(), high=high.tolist(), mean=mean.round(3).tolist())


def numbers(values: Float[ndarray, " S"], window: Window) -> Numbers:
    """Numbers over time, to four decimals."""
    low, high, mean = (part.round(4).tolist() for part in _summary(values, window))
    return Numbers(low=low, high=high, mean=mean)


def deviation(weights: Float[ndarray, " J"], fusion_method: str) -> float:
    """Standard deviation of the number of people, sqrt(var N).

    The people of a multi-Bernoulli exist independently: the variances of their existences add up
    to Σ r (1 − r). A PHD takes the number for Poisson distributed (Mahler 2003, IEEE TAES 39(4)):
    its variance is its mean, Σ w.

    Args:
        weights: Existences, or expected numbers of people.
        fusion_method: Whose they are.
    """
    if fusion_method == "sequential_phd":
        return math.sqrt(float(weights.sum()))
    existences = np.clip(weights, 0.0, 1.0)
    return math.sqrt(float((existences * (1.0 - existences)).sum()))


def _summary(values: ndarray, window: Window) -> tuple[ndarray, ndarray, ndarray]:
    starts = window.starts(len(values)) - window.first
    part = values[window.first : window.end]
    if not len(starts):
        return part, part, part.astype(float)
    sizes = np.diff(np.append(starts, len(part)))
    return (
        np.minimum.reduceat(part, starts),
        np.maximum.reduceat(part, starts),
        np.add.reduceat(part.astype(float), starts) / sizes,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Spans:
    """Consecutive steps of each track in which it is seen, or not seen, by any camera."""

    ids: Int[ndarray, " N"]
    first: Int[ndarray, " N"]
    last: Int[ndarray, " N"]
    seen: Bool[ndarray, " N"]
    cameras: Int[ndarray, "N C"]
    """In how many of the steps each camera saw it."""

    @staticmethod
    def of(tracks: Trajectories, done: int) -> _Spans:
        """Of the first ``done`` steps, sorted by track and step."""
        rows = slice(0, tracks.at(done).start)
        frames, ids = tracks.frames[rows], tracks.ids[rows]
        order = np.lexsort((frames, ids))
        frames, ids, each = frames[order], ids[order], tracks.seen[rows][order]
        seen = np.any(each, axis=1)
        begins = np.ones(len(frames), dtype=bool)
        begins[1:] = (np.diff(ids) != 0) | (np.diff(frames) != 1) | (seen[1:] != seen[:-1])
        starts = np.flatnonzero(begins)
        ends = np.append(starts[1:], len(frames))[: len(starts)]
        before = np.zeros((len(frames) + 1, each.shape[1]), dtype=np.int64)
        np.cumsum(each, axis=0, out=before[1:])
        sights = before[ends] - before[starts]
        return _Spans(ids[starts], frames[starts], frames[ends - 1], seen[starts], sights)


def names_of(run: Run) -> dict[int, str]:
    """The names of a finished run's tracks, by id: what somebody said goes before what the colours
    say."""
    return {**Names().by_track(run), **given_names(run)}


class Timelines:
    """Makes timelines; remembers what it counted of the run it was asked for last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._run: Run | None = None
        self._revision = 0
        self._cardinality: list[float] = []
        self._deviation: list[float] = []
        self._names = Names()
        self._counted: tuple[Trajectories, int, _Spans, Int[ndarray, " D"]] | None = None
        self._sequence: Sequence | None = None
        self._truth: Int[ndarray, " S"] | None = None
        self._alike: tuple[tuple[str, str, int], Trajectories | None, dict[int, int]] = (
            ("", "", 0), None, {},
        )  # fmt: skip

    def of(
        self, sequence: Sequence, run: Run | None, window: Window, pinned: Scored | None = None
    ) -> Timeline:
        """The shown run over time, as far as it is computed and as the window shows it.

        Args:
            sequence: That is open.
            run: That is shown.
            window: The part that somebody looks at.
            pinned: The run that it is compared with, if there is one.
        """
        with self._lock:
            return self._of(sequence, run, window, pinned)

    def _of(
        self, sequence: Sequence, run: Run | None, window: Window, pinned: Scored | None
    ) -> Timeline:
        if run is not self._run:
            self._run, self._cardinality, self._counted = run, [], None
            self._deviation, self._names, self._revision = [], Names(), 0
        if run is not None:
            # the thread that computes it goes on, and replaces its tracks
            run = run.snapshot()
            if run.revision != self._revision:
                self._revision, self._names = run.revision, Names()
        if sequence is not self._sequence:
            self._sequence, self._truth = sequence, _truth_counts(sequence)
        done, count = 0, np.zeros(0, dtype=np.int64)
        lives: list[TrackLife] = []
        events: list[LaneEvent] = []
        decisions: list[Named] = []
        left_out = 0
        if run is not None:
            done = run.done
            known = len(self._cardinality)
            for weights in run.fused.values("posterior.weights", first=known, last=done):
                self._cardinality.append(float(weights.sum()))
                self._deviation.append(deviation(weights, run.parameters.fusion_method))
            tracks, counted = run.tracks, self._counted
            # the smoothed tracks take the place of the filter's of as many steps
            if counted is None or counted[0] is not tracks or counted[1] != done:
                frames = tracks.frames[: int(np.searchsorted(tracks.frames, done))]
                self._counted = counted = (
                    tracks, done, _Spans.of(tracks, done), np.bincount(frames, minlength=done)
                )  # fmt: skip
            _, _, spans, count = counted
            shortest = math.ceil(LONG_MISS * sequence.fps)
            lives, left_out = _lives(spans, window, shortest)
            events = _events(spans, done, shortest)
            decisions = decided(run)
            found = [(one.step, one.track, one.decision.kind) for one in decisions]
            events = sorted([*events, *found], key=lambda e: e[:2])[:MOST_EVENTS]
            # what somebody said goes before what the colours say
            said = given_names(run)
            names = {**self._names.by_track(run), **run.stored_names, **said}
            for life in lives:
                life.name = names.get(life.id)
        return Timeline(
            run=run.key if run is not None else "",
            done=done,
            frames=sequence.frames,
            first=window.first,
            stride=window.stride,
            cardinality=numbers(np.array(self._cardinality), window),
            deviation=numbers(np.array(self._deviation), window),
            count=counts(count, window),
            truth=None if self._truth is None else counts(self._truth, window),
            tracks=lives,
            pinned=self._pinned(sequence, run, window, pinned),
            events=events,
            decisions=[
                Decided(step=one.step, track=one.track, kind=one.decision.kind, words=one.words)
                for one in decisions[:MOST_EVENTS]
            ],
            left_out=left_out,
        )

    def events(self, sequence: Sequence, run: Run) -> list[LaneEvent]:
        """What happens to the tracks of the shown run, as far as it is computed."""
        return self.of(sequence, run, Window.of(sequence.frames, 0, 0)).events

    def _pinned(
        self, sequence: Sequence, run: Run | None, window: Window, pinned: Scored | None
    ) -> PinnedTimeline | None:
        if pinned is None or run is None or pinned.key == run.key:
            return None
        done = min(run.done, pinned.steps)
        key = (pinned.key, run.key, done)
        tracks = run.tracks
        if key != self._alike[0] or self._alike[1] is not tracks:
            self._alike = (key, tracks, alike(pinned.tracks, tracks, done))
        like = self._alike[2]
        spans = _Spans.of(pinned.tracks, pinned.steps)
        lives, _ = _lives(spans, window, math.ceil(LONG_MISS * sequence.fps))
        count = np.bincount(pinned.tracks.frames, minlength=pinned.steps)[: pinned.steps]
        return PinnedTimeline(
            run=pinned.key,
            count=counts(count, window),
            tracks=[PinnedLife(**life.model_dump(), like=like.get(life.id)) for life in lives],
        )


def lives_of(tracks: Trajectories, done: int, fps: float, window: Window) -> list[TrackLife]:
    """The lives of tracks by themselves, without a run, as the window shows them."""
    lives, _ = _lives(_Spans.of(tracks, done), window, math.ceil(LONG_MISS * fps))
    return lives


def _truth_counts(sequence: Sequence) -> Int[ndarray, " S"] | None:
    truth = sequence.ground_truth
    if truth is None:
        return None
    counted = truth.frames[truth.valid]  # the others are neither missed nor false
    return np.bincount(counted, minlength=sequence.frames)[: sequence.frames]


def _events(spans: _Spans, done: int, shortest: int) -> list[LaneEvent]:
    """Births after the first step, deaths before the newest one, and long misses, by step."""
    if not len(spans.ids):
        return []
    heads = np.flatnonzero(np.diff(spans.ids, prepend=-1))
    tails = np.append(heads[1:], len(spans.ids)) - 1
    born = heads[spans.first[heads] > 0]
    dead = tails[spans.last[tails] < done - 1]
    lost = np.flatnonzero(~spans.seen & (spans.last - spans.first + 1 >= shortest))
    kinds: tuple[Literal["birth", "death", "long miss"], ...] = ("birth", "death", "long miss")
    steps = np.concatenate([spans.first[born], spans.last[dead], spans.first[lost]])
    ids = np.concatenate([spans.ids[born], spans.ids[dead], spans.ids[lost]])
    which = np.repeat(np.arange(3), [len(born), len(dead), len(lost)])
    order = np.lexsort((ids, steps))[:MOST_EVENTS]
    return [(int(steps[i]), int(ids[i]), kinds[which[i]]) for i in order]


def _lives(spans: _Spans, window: Window, shortest: int) -> tuple[list[TrackLife], int]:
    """The tracks that live in the window, and how many more there are."""
    heads = np.flatnonzero(np.diff(spans.ids, prepend=-1))
    tails = np.append(heads[1:], len(spans.ids))[: len(heads)]
    inside = (spans.first[heads] < window.end) & (spans.last[tails - 1] >= window.first)
    chosen = np.flatnonzero(inside)
    lengths = spans.last[tails - 1] - spans.first[heads] + 1
    if len(chosen) > MOST_TRACKS:  # the longest, in the order of their ids
        chosen = np.sort(chosen[np.argsort(-lengths[chosen], kind="stable")[:MOST_TRACKS]])
    lives = []
    for i in chosen.tolist():
        rows = slice(int(heads[i]), int(tails[i]))
        steps = (spans.last[rows] - spans.first[rows] + 1)[spans.seen[rows]]
        lives.append(
            TrackLife(
                id=int(spans.ids[heads[i]]),
                first=int(spans.first[heads[i]]),
                last=int(spans.last[tails[i] - 1]),
                seen=round(float(steps.sum() / lengths[i]), 4),
                cameras=(spans.cameras[rows].sum(axis=0) / lengths[i]).round(4).tolist(),
                spans=_spans_of(spans, rows, window, shortest),
            )
        )
    return lives, int(inside.sum()) - len(chosen)


def _spans_of(spans: _Spans, rows: slice, window: Window, shortest: int) -> list[Span]:
    """A track's spans within the window; what is shorter than a bucket joins its neighbour.

    A joined span is what most of its steps are. So a lane has at most as many spans as
    there are buckets, and none is lost where it is as long as a bucket.
    """
    shown: list[list[Any]] = []  # first, last, steps seen, whether a long miss is in it
    firsts, lasts, sights = spans.first[rows], spans.last[rows], spans.seen[rows]
    long = ~sights & (lasts - firsts + 1 >= shortest)
    there = np.flatnonzero((lasts >= window.first) & (firsts < window.end))
    for i in there.tolist():
        first = max(int(firsts[i]), window.first)
        last = min(int(lasts[i]), window.end - 1)
        seen = last - first + 1 if sights[i] else 0
        before = shown[-1] if shown else None
        if before is not None and first - before[1] <= window.stride:
            is_short = last - first + 1 < window.stride
            if is_short or before[1] - before[0] + 1 < window.stride:
                before[1:] = last, before[2] + seen, before[3] or bool(long[i])
                continue
        shown.append([first, last, seen, bool(long[i])])
    kind: dict[bool, Literal["coasting", "long miss"]] = {False: "coasting", True: "long miss"}
    return [
        (first, last, "seen" if 2 * seen > last - first + 1 else kind[is_long])
        for first, last, seen, is_long in shown
    ]

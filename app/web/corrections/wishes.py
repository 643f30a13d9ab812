"""What a page says of tracks of the shown run, as corrections of steps and places."""

from __future__ import annotations

from app.models.correcting import CorrectionWish
from app.state.snapshot import Snapshot
from tracker.corrections import Correction, CorrectionError, Place
from tracker.corrections.kinds import KINDS, make
from tracker.corrections.pointing import foot_on_floor, ground_under, stands, triangulate
from tracker.review.queue.item import WITHIN, TrackRows
from tracker.sequences.sequence import Sequence


def corrections_of(wish: CorrectionWish, snapshot: Snapshot, note: str) -> tuple[Correction, ...]:
    """What a wish says.

    Args:
        wish: Of tracks of the shown run.
        snapshot: With that run.
        note: Written beside each.

    Raises:
        CorrectionError: If it means nobody, or is not what its kind needs.
    """
    sequence = snapshot.sequence
    if sequence is None:
        raise CorrectionError("no recording is open")
    if wish.kind == "checked":
        return (make(kind="checked", first=wish.first, last=wish.last, note=note),)
    step = snapshot.playhead if wish.step is None else wish.step
    for one in (step, wish.to, wish.first, wish.last):
        if one is not None and one >= sequence.frames:
            raise CorrectionError(f"step: expected 0 … {sequence.frames - 1}, found {one}")
    if wish.kind == "here" and (wish.clicks or wish.place is not None):
        return (_here(wish, snapshot, sequence, step, note),)
    return _of_tracks(wish, snapshot, step, note)


def _of_tracks(
    wish: CorrectionWish, snapshot: Snapshot, step: int, note: str
) -> tuple[Correction, ...]:
    if snapshot.run is None:
        raise CorrectionError("there is no run yet whose tracks could be meant")
    lanes = TrackRows(snapshot.run.tracks)
    needed = 2 if wish.kind in ("exchanged", "same") else 1
    if len(wish.tracks) != needed or len(set(wish.tracks)) != needed:
        raise CorrectionError(
            f"tracks: {wish.kind} is of {needed} of them, found {len(wish.tracks)}"
        )
    for track in wish.tracks:
        if track not in lanes.rows:
            raise CorrectionError(f"tracks: the shown run has no track {track}")
    one = wish.tracks[0]
    if wish.kind == "exchanged":
        back = () if wish.to is None else (_exchanged(lanes, wish.tracks, wish.to, note),)
        return (_exchanged(lanes, wish.tracks, step, note), *back)
    if wish.kind == "same":
        first, second = sorted(wish.tracks, key=lambda track: lanes.span(track)[1])
        if wish.step is None or lanes.span(first)[1] < lanes.span(second)[0]:
            begin = lanes.span(second)[0]
            end = min(lanes.span(first)[1], max(begin - 1, lanes.span(first)[0]))
        else:
            begin, end = step, step - 1
        places = [lanes.place(first, end), lanes.place(second, begin, after=True)]
        return (make(kind="same", places=places, note=note),)
    if wish.kind == "different":
        before, after = lanes.place(one, step - 1), lanes.place(one, step, after=True)
        if before.step >= after.step:
            raise CorrectionError(f"step: track {one} begins or ends there, and cannot be cut")
        return (make(kind="different", places=[before, after], note=note),)
    if wish.kind == "nobody":
        return (_nobody(lanes, one, wish, note),)
    if wish.kind in ("came", "left"):
        at = wish.step
        if at is None:
            at = lanes.span(one)[wish.kind == "left"]
        place = lanes.place(one, at, after=wish.kind == "came")
        return (make(kind=wish.kind, places=[place], note=note),)
    place = lanes.place(one, step)
    if wish.kind == "name":
        return (make(kind="name", places=[place], name=wish.name, note=note),)
    return (make(kind="here", places=[place], accuracy=wish.accuracy, note=note),)


def _here(
    wish: CorrectionWish, snapshot: Snapshot, sequence: Sequence, step: int, note: str
) -> Correction:
    """Where somebody is; who is meant by where the shown run has the track."""
    places = [_place(wish, snapshot, sequence, step)]
    low, high = sequence.room.minimum, sequence.room.maximum
    if not all(low[k] <= places[0][1 + k] <= high[k] for k in (0, 1)):
        raise CorrectionError(
            f"place: {places[0].words} lies outside the room, x {low[0]:.1f} … {high[0]:.1f} and "
            f"y {low[1]:.1f} … {high[1]:.1f} m, where nobody is tracked; make the room larger first"
        )
    meant = _shown_at(wish, snapshot, step)
    if meant is not None:
        places.append(meant)
    return make(kind="here", places=places, accuracy=wish.accuracy, note=note)


def _exchanged(lanes: TrackRows, tracks: list[int], step: int, note: str) -> Correction:
    one, other = tracks
    before = [lanes.place(track, step - 1) for track in (one, other)]
    after = [lanes.place(track, step, after=True) for track in (other, one)]
    for track, place in zip((one, other, other, one), (*before, *after), strict=True):
        at_all = lanes.span(track)
        if (place in before) != (place.step < step):
            raise CorrectionError(
                f"step: track {track} is there from step {at_all[0]} to {at_all[1]} only, so it "
                f"cannot be exchanged at step {step}"
            )
    return make(kind="exchanged", places=[*before, *after], note=note)


def _nobody(lanes: TrackRows, track: int, wish: CorrectionWish, note: str) -> Correction:
    begin, end = lanes.span(track)
    first = begin if wish.first is None else wish.first
    last = end if wish.last is None else wish.last
    frames = lanes.tracks.frames[lanes.rows[track]]
    own = lanes.rows[track][(frames >= first) & (frames <= last)]
    if not len(own):
        raise CorrectionError(f"first, last: track {track} is not there between them")
    around = KINDS["nobody"].accuracy if wish.accuracy is None else wish.accuracy
    places = lanes.simplified_path(own, WITHIN * (around or 0.0))
    return make(kind="nobody", places=places, accuracy=wish.accuracy, note=note)


def _place(wish: CorrectionWish, snapshot: Snapshot, sequence: Sequence, step: int) -> Place:
    if wish.place is not None:
        return Place(step, *wish.place)
    cameras = {camera.name: camera for camera in sequence.cameras}
    for click in wish.clicks:
        if click.camera not in cameras:
            raise CorrectionError(f"clicks: there is no camera {click.camera}")
    points = [(cameras[click.camera], (click.x, click.y)) for click in wish.clicks]
    half_height = float(sequence.target_half_extents[2])
    meant = _shown_at(wish, snapshot, step)
    feet = None if meant is None else meant.z - half_height
    ground = ground_under(feet, floor=float(sequence.room.minimum[2]), half_height=half_height)
    if len(points) == 1:
        found = foot_on_floor(*points[0], floor=ground, half_height=half_height)
    else:
        found = triangulate(points)
        # any point of somebody who stands says where: the middle is half a person over the floor
        if stands(float(found[2]), ground=ground, half_height=half_height):
            found[2] = ground + half_height
    return Place(step, *found.tolist())


def _shown_at(wish: CorrectionWish, snapshot: Snapshot, step: int) -> Place | None:
    """Where the shown run has the track that is meant, if it is there."""
    if snapshot.run is None or not wish.tracks:
        return None
    lanes = TrackRows(snapshot.run.tracks)
    if wish.tracks[0] not in lanes.rows:
        return None
    found = lanes.place(wish.tracks[0], step)
    return found if found.step == step else None

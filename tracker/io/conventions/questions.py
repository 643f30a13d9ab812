"""What an import asks where the files leave open how they are meant, and what it says else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from tracker.geometry.consistency.odds import DECISIVE, log_odds
from tracker.io.conventions.reading import Reading, exchanged, exchanges, with_pixels
from tracker.io.conventions.search import ClockFit, Verdict
from tracker.io.read.pieces import FormatError, Layout, RawCamera
from tracker.sequences.finding import Remedy

ACCEPT = "--accept-best"
"""The flag that takes the likelier interpretation."""

OF_TWO = (
    "boxes of two cameras alone do not tell whether one of them was turned or moved, nor which is "
    "which where they stand alike: a third camera would"
)
"""What is said of every import of two cameras."""

OF_ONE = (
    "boxes of one camera alone confirm nothing of its calibration: neither its pose, which way is "
    "up, nor its unit"
)
"""What is said of an import of one camera with boxes."""

Part = Literal[
    "direction", "axes", "layout", "parts", "turns", "order", "mirrored", "flipped", "pixels",
    "scene",
]  # fmt: skip
"""What two interpretations may differ in; the scene where none of the others does."""

UNPROVEN = (
    "too few boxes of several cameras meet to confirm the calibration, which camera is which, how "
    "boxes are meant or that all show the same moments"
)
"""What is said of an import whose boxes prove nothing."""

LAYOUTS: dict[Layout, str] = {
    "ltwh": "left, top and size",
    "xyxy": "two corners",
    "yxyx": "two corners, y before x",
    "cxcywh": "centre and size",
}
"""What the four numbers of a box are, in words."""

PARTS = {
    0: "pixels",
    1: "parts of the picture's size",
    100: "per cent of the picture's size",
    1000: "thousandths of the picture's size",
}
"""What numbers of boxes count, in words."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is open: two interpretations, what differs and the flags that decide."""

    code: Part
    """The first part of the interpretation that differs."""
    interpretations: tuple[str, str]
    """In words, the likelier one first."""
    difference: str
    """What differs, and how sure the likelier one is."""
    remedies: tuple[tuple[Remedy, ...], tuple[Remedy, ...]]
    """The flags that decide for each."""

    @property
    def flags(self) -> tuple[str, str]:
        """The flags that decide for each, as they are typed."""
        first, second = (" ".join(map(str, own)) for own in self.remedies)
        return first, second


class Undecided(FormatError):
    """The files leave open how they are meant."""

    def __init__(self, question: Question) -> None:
        """Begin.

        Args:
            question: What is asked.
        """
        self.question = question
        first, second = question.interpretations
        one, other = question.flags
        super().__init__(
            f"{question.difference}: {first} ({one}), or {second} ({other})? {ACCEPT} takes the "
            "first"
        )


class Unexplained(FormatError):
    """No interpretation explains the boxes."""


def check_verdict(
    verdict: Verdict,
    cameras: Sequence[RawCamera],
    stated: str = "",
    otherwise: Verdict | None = None,
    named: Layout | None = None,
) -> Undecided | Unexplained | None:
    """Return what is to be asked, or why to refuse, where the boxes do not decide, or contradict
    what their files say of them.

    Args:
        verdict: What they tell.
        cameras: As they are given.
        stated: The flags that leave no interpretation that explains the boxes, or several.
        otherwise: What the boxes tell without these, where that is decided over them.
        named: The layout of the boxes by their files; None where these leave it open.
    """
    names = [camera.name for camera in cameras]
    best = verdict.best.reading
    share = 100.0 * verdict.best.evidence.share
    if otherwise is not None:
        other = otherwise.best.reading
        return Unexplained(
            f"with {stated} {share:.0f} % of a camera's boxes are explained by another camera's, "
            f"without it {100.0 * otherwise.best.evidence.share:.0f} % "
            f"({in_words(other, names, _differing(other, best))}); {ACCEPT} imports them as they "
            "are"
        )
    if verdict.kind == "none":
        return Unexplained(
            f"no interpretation{f' with {stated}' if stated else ''} explains these boxes; the "
            f"closest, {in_words(best, names)}, explains {share:.0f} % of a camera's boxes by "
            "another camera's: check that calibration and boxes belong together and are of the "
            f"same moments; {ACCEPT} imports them as they are"
        )
    if best.flipped:
        return Unexplained(
            "the boxes are of pictures whose left and right are exchanged: with them mirrored "
            f"{share:.0f} % are explained by another camera's; "
            f"mirror pictures and boxes; {ACCEPT} imports them as they are"
        )
    if verdict.kind in ("decided", "open") and named not in (None, best.layout):
        return Undecided(_question(
            best, replace(best, layout=named), names,
            f"the files name the boxes' numbers {LAYOUTS[named]}, but {share:.0f} % of a camera's "
            f"boxes are explained by another camera's if they are {LAYOUTS[best.layout]}",
        ))  # fmt: skip
    if verdict.kind == "open" and verdict.rival is not None:
        return Undecided(_open(best, verdict.rival.reading, verdict.odds, names))
    return None


def _differing(one: Reading, other: Reading) -> list[Part]:
    """The parts in which two readings differ."""
    parts = (part for part in get_args(Part) if part != "scene")
    return [part for part in parts if getattr(one, part) != getattr(other, part)]


def _open(best: Reading, rival: Reading, odds: float, names: Sequence[str]) -> Question:
    sure = "as likely" if odds < math.log(2.0) else f"{math.exp(min(odds, 7.0)):.0f} : 1"
    differing = _differing(best, rival)
    words = {"layout": "boxes", "parts": "what numbers of boxes count",
             "order": "which calibration is whose", "turns": "angles",
             "direction": "where R and t lead", "axes": "axes of cameras",
             "mirrored": "handedness of the world", "flipped": "left and right of the pictures",
             "pixels": "size of the pictures"}  # fmt: skip
    what = " and ".join(words[part] for part in differing) or "the scene"
    return _question(best, rival, names, f"the files leave open {what} ({sure})")


def _question(best: Reading, rival: Reading, names: Sequence[str], difference: str) -> Question:
    differing = _differing(best, rival)
    return Question(
        differing[0] if differing else "scene",
        (in_words(best, names, differing), in_words(rival, names, differing)),
        difference,
        (_flags(best, rival, names), _flags(rival, best, names)),
    )


def stating_flags(wanted: Reading, other: Reading, names: Sequence[str]) -> list[Remedy]:
    """The flags of an import that state what one interpretation has and the other has not.

    Args:
        wanted: The interpretation to state.
        other: The interpretation that it is told from.
        names: The names of the cameras.
    """
    flags = []
    if wanted.direction != other.direction:
        flags.append(Remedy("--pose", wanted.direction))
    if wanted.axes != other.axes:
        flags.append(Remedy("--axes", wanted.axes))
    normalised = "-normalised" if wanted.parts == 1 != other.parts else ""
    if wanted.layout != other.layout or normalised:
        flags.append(Remedy("--boxes", f"{wanted.layout}{normalised}"))
    if wanted.turns != other.turns:
        flags.append(Remedy("--euler", wanted.turns.split(" in ")[0]))
    if wanted.order is not None and wanted.order != other.order:
        pairs = exchanges(wanted.order, names)
        flags += [Remedy("--swap", f"{first}={second}") for first, second in pairs]
    elif wanted.order != other.order:
        flags.append(Remedy("--as-named", ""))
    return flags


def _flags(wanted: Reading, other: Reading, names: Sequence[str]) -> tuple[Remedy, ...]:
    """The flags that decide for an interpretation; the one that accepts it where none states it."""
    return tuple(stating_flags(wanted, other, names)) or (Remedy(ACCEPT, ""),)


def in_words(reading: Reading, names: Sequence[str], parts: Sequence[str] = ()) -> str:
    """A reading in words, or some parts of it."""
    every = {
        "direction": f"poses {reading.direction}",
        "axes": "y down and z ahead" if reading.axes == "opencv" else "y up and z back",
        "layout": f"boxes as {LAYOUTS[reading.layout]}",
        "parts": f"in {PARTS[reading.parts]}" if reading.parts or "parts" in parts else "",
        "turns": f"angles {reading.turns}" if reading.turns else "",
        "order": "calibrations as given"
        if reading.order is None
        else f"calibrations exchanged ({exchanged(reading.order, names)})",
        "mirrored": "a mirrored world" if reading.mirrored else "",
        "flipped": "pictures with left and right exchanged" if reading.flipped else "",
        "pixels": f"pictures {reading.pixels:g} times as wide" if reading.pixels != 1.0 else "",
    }
    chosen = [words for part, words in every.items() if words and (not parts or part in parts)]
    return ", ".join(chosen) or "as given"


def rearranged(
    raws: Sequence[RawCamera], reading: Reading
) -> tuple[list[RawCamera], list[tuple[str, str]]]:
    """The cameras for the boxes that are theirs, and for the pictures that these are of.

    Returns:
        The cameras, and what has changed and why.
    """
    found: list[tuple[str, str]] = []
    names = [raw.name for raw in raws]
    order = reading.order or tuple(range(len(raws)))
    if order != tuple(range(len(raws))):
        flags = " ".join(f"--swap {a}={b}" for a, b in exchanges(order, names))
        found.append(("exchanged", f"{exchanged(order, names)}, since boxes meet so; {flags}"))
    if reading.mirrored:
        found.append(("mirrored", "the calibration's world is left-handed; its y axis is mirrored"))
    if reading.pixels != 1.0:
        why = f"{reading.pixels:.4g} times as large as the calibration's, since boxes meet so"
        found.append(("image size", why))
    changed = [with_pixels(raws[own], reading.pixels) for own in order]
    return [replace(raw, name=name) for raw, name in zip(changed, names, strict=True)], found


_TIMES = "give the time of each frame, timestamps in sequence.toml"


def describe_clocks(clocks: Mapping[int, ClockFit], names: Sequence[str], fps: float) -> list[str]:
    """Return a sentence for each camera that lost frames, or whose clock drifts.

    Args:
        clocks: Those that are not as the others', by camera.
        names: Of the cameras.
        fps: Steps a second.
    """
    return [
        f"{names[camera]}: {_uneven(clock, fps)}; {_TIMES}"
        for camera, clock in clocks.items()
        if not clock.steady
    ]


def _uneven(clock: ClockFit, fps: float) -> str:
    """What a clock that jumps or drifts does, in words."""
    if clock.drifts is not None:
        first, last = clock.drifts
        rate = fps * (1.0 + (clock.ends - clock.begins) / max(last - first, 1))
        return (
            f"its clock drifts: it is {_late(clock.begins, fps)} at step {first} and "
            f"{_late(clock.ends, fps)} at step {last}, as if it had {rate:.4g} frames a second in "
            f"place of {fps:.4g}"
        )
    assert clock.jump is not None
    own = clock.jump + clock.begins
    lost = clock.begins - clock.ends
    before = f"; before, it is {_late(clock.begins, fps)}" if abs(clock.begins) > 1 else ""
    if lost > 0:
        return (
            f"it lost about {lost} frames ({lost / fps:.2f} s) before its frame {own} "
            f"({own / fps:.1f} s), and is ahead of the others from there on{before}"
        )
    return (
        f"from its frame {own} ({own / fps:.1f} s) on it is {-lost} frames ({-lost / fps:.2f} s) "
        f"behind: it has frames twice, or paused{before}"
    )


def _late(steps: int, fps: float) -> str:
    words = "late" if steps >= 0 else "early"
    return f"{abs(steps)} steps ({abs(steps) / fps:.2f} s) {words}"


class Unconfirmed(NamedTuple):
    """Cameras whose boxes nothing confirms to show the others' moments, and sentences on them."""

    alone: str
    """On those whose boxes agree with those of no other camera; empty where there are none."""
    others: str
    """On those whose boxes agree, but as well with those of other moments; empty likewise."""
    without: tuple[str, ...]
    """The names of the former."""
    doubtful: tuple[str, ...]
    """The names of the latter."""


def describe_unconfirmed(verdict: Verdict, names: Sequence[str], fps: float) -> Unconfirmed:
    """Describe the cameras that nothing confirms: an import and the check of what it wrote say it
    in these words.

    Args:
        verdict: What the boxes tell.
        names: Of the cameras.
        fps: Steps a second.
    """
    confirmed = verdict.confirmed
    failing = [
        camera
        for camera, odds in confirmed.items()
        if odds < DECISIVE and camera not in verdict.moved
    ]
    evidence = verdict.best.evidence
    nothing = np.zeros(evidence.moments)
    alone = [c for c in failing if log_odds(evidence.of_camera(c), nothing) < DECISIVE]
    if 2 * len(failing) >= len(confirmed):
        alone = []  # it is not known which of them are the ones that do not belong
    without = tuple(names[c] for c in alone)
    rest = tuple(names[c] for c in failing if c not in alone)
    shows = "it shows" if len(rest) == 1 else "they show"
    moments = "the same moments" if len(rest) == len(confirmed) else "the moments of the others"
    return Unconfirmed(
        f"{', '.join(without)}: boxes agree with those of no other camera: another recording, a "
        f"camera that was moved, or late by more than {verdict.reach / fps:.2g} s"
        if without
        else "",
        f"{', '.join(rest)}: nothing confirms that {shows} {moments}" if rest else "",
        without,
        rest,
    )


def describe_moved(moved: Mapping[int, float], names: Sequence[str]) -> list[str]:
    """Return a sentence for each camera that was turned since it was calibrated."""
    return [
        f"{names[camera]}: its boxes would meet those of the other cameras better if it were "
        f"turned by about {np.degrees(angle):.0f}°: it was moved after it was calibrated, or its "
        "calibration is another's; calibrate it anew, or leave it out"
        for camera, angle in moved.items()
    ]

"""Every stage of every method gives what it gave before: see the package for how to accept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.golden import files
from tests.golden.combinations import Combination, alternatives, combinations, runs
from tests.golden.exact import WITH_ALTERNATIVES
from tests.golden.fingerprint import fingerprints
from tests.golden.pieces import PIECES, Piece
from tracker.parameters.catalogue import RunParameters

MOST_LINES = 40

ACCEPT = (
    "If every one of these is what a change was to bring about, accept them with "
    "`pytest tests/golden --update-golden` (and `--long` where the longer form differs) "
    "and commit tests/golden/expected with the change."
)


ONE_ROOM = "room44-3p"
"""What the short form looks at, with the default methods: the hardest of the rooms."""


def _parameters(
    pieces: Iterable[Piece], other_rooms: pytest.MarkDecorator = pytest.mark.full
) -> list[object]:
    """The pieces as parameters of a test, with a mark for the rooms other than the hardest."""
    return [
        pytest.param(
            piece,
            id=piece.name,
            marks=pytest.mark.data
            if piece.real
            else pytest.mark.full
            if piece.name == ONE_ROOM
            else other_rooms,
        )
        for piece in pieces
    ]


DRAWS = {
    (
        "wildtrack-points-300",
        "robust jpda jpda.measurements=detections multi_bernoulli",
    ),
}
"""Longer pieces and runs that differ between machines: in a crowd that JPDA sees from one camera
some joins are draws to the last digits, and linear algebra rounds by the processor."""


every_piece = pytest.mark.parametrize("piece", _parameters(PIECES))


@pytest.fixture
def data(piece: Piece, request: pytest.FixtureRequest) -> Path:
    """The folder of the real recordings, which a rendered room does not ask for."""
    folder: Path = request.getfixturevalue("data_folder") if piece.real else Path()
    return folder


@pytest.fixture
def check(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> Callable[[str, files.Fingerprints], None]:
    """Compare with the kept file, or write it where that was asked for."""

    def checked(name: str, found: files.Fingerprints) -> None:
        differ = files.differences(name, files.read(name), found)
        if request.config.getoption("--update-golden"):
            if differ:
                files.write(name, found)
                with capsys.disabled():
                    print("\n" + "\n".join(differ))
        elif differ:
            more = len(differ) - MOST_LINES
            told = differ[:MOST_LINES] + ([f"… and {more} more"] if more > 0 else [])
            pytest.fail("\n".join([*told, "", ACCEPT]), pytrace=False)

    return checked


@pytest.mark.parametrize("piece", _parameters(PIECES, other_rooms=pytest.mark.long))
def test_every_stage_gives_what_it_gave(
    piece: Piece, data: Path, check: Callable[[str, files.Fingerprints], None]
) -> None:
    sequence = piece.open(data)
    check(piece.name, fingerprints(runs(sequence, piece.steps, combinations(sequence))))


def test_the_default_methods_give_what_they_gave_in_the_hardest_room() -> None:
    piece = next(piece for piece in PIECES if piece.name == ONE_ROOM)
    sequence = piece.open(Path())
    names = {combination.view_name for combination in combinations(sequence)}
    default = Combination("robust", RunParameters().single_view, RunParameters().fusion_method)
    assert default.view_name in names
    found = fingerprints(runs(sequence, piece.steps, [default]))
    kept = files.read(piece.name)
    differ = files.differences(piece.name, {name: kept[name] for name in found}, found)
    assert not differ, "\n".join([*differ[:MOST_LINES], "", ACCEPT])


@pytest.mark.long
@pytest.mark.parametrize("piece", _parameters([one for one in PIECES if not one.pictures]))
def test_longer_pieces_of_boxes_give_what_they_gave(
    piece: Piece, data: Path, check: Callable[[str, files.Fingerprints], None]
) -> None:
    sequence = piece.open(data)
    found = fingerprints(runs(sequence, piece.long_steps, combinations(sequence)), short=True)
    kept = {run: told for run, told in found.items() if (piece.name, run) not in DRAWS}
    check(f"{piece.name}-long", kept)


@pytest.mark.parametrize(
    "piece", _parameters([one for one in PIECES if one.name in WITH_ALTERNATIVES])
)
def test_every_choice_gives_what_it_gave(
    piece: Piece, data: Path, check: Callable[[str, files.Fingerprints], None]
) -> None:
    sequence = piece.open(data)
    found = fingerprints(runs(sequence, piece.steps, alternatives(sequence)), short=True)
    check(f"{piece.name}-choices", found)


@every_piece
def test_people_are_found_in_every_piece(piece: Piece) -> None:
    kept = files.read(piece.name)
    robust = {name: run for name, run in kept.items() if name.startswith("robust")}
    tracked = {name: run for name, run in robust.items() if "tracks" in run}
    assert tracked
    for name, run in tracked.items():
        people = run["tracks"]["all"][0]
        assert people is not None, name
        # the trees of people by shape learnt from rendered people, and miss some real ones
        least = 0.75 if " shapes" in name else 1.0
        assert people >= least * piece.steps, name

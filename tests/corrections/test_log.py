"""The log: what is written is read again, what is wrong is told with its line."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.corrections import Correction, CorrectionError
from tracker.corrections.consistency import find_repeated, refuse_contradiction
from tracker.corrections.kinds import KINDS, digest, make
from tracker.corrections.log import (
    FILE,
    dump,
    open_log,
    own_place,
    parse,
    place_of,
    read_log,
    remark_on,
    write_log,
    writing_place,
)
from tracker.corrections.merging import difference, merge
from tracker.sequences.built_in import ROOMS

_NUMBERS = st.floats(-50.0, 50.0).map(lambda v: round(v, 4))
_TIMES = st.datetimes(datetime(2020, 1, 1), datetime(2030, 1, 1)).map(
    lambda time: time.replace(microsecond=0, tzinfo=UTC)
)
_NOTES = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=20)


@st.composite
def corrections(draw: st.DrawFn) -> Correction:
    """Any one."""
    kind = draw(st.sampled_from(sorted(KINDS)))
    fewest, most = KINDS[kind].places
    count = draw(st.integers(fewest, 5 if most is None else most))
    steps = sorted(draw(st.sets(st.integers(0, 900), min_size=count, max_size=count)))
    if kind == "here":  # where somebody is, and where he was taken to be at the same step
        steps = steps[:1] * count
    values: dict[str, object] = {
        "places": [[step, draw(_NUMBERS), draw(_NUMBERS), draw(_NUMBERS)] for step in steps]
    }
    if kind == "name":
        values["name"] = draw(st.sampled_from(["Anna", 'a "quoted" one', "ü"]))
    if kind == "checked":
        values |= {"first": draw(st.integers(0, 5)), "last": draw(st.integers(5, 9))}
    return make(kind=kind, time=draw(_TIMES), note=draw(_NOTES), **values)


@pytest.mark.full
@given(st.lists(corrections(), max_size=6))
def test_a_log_is_read_as_it_was_written(told: list[Correction]) -> None:
    kept: list[Correction] = []
    for one in told:
        if all(one.id != other.id for other in kept):
            try:
                refuse_contradiction(kept, one)
            except CorrectionError:
                continue
            kept.append(one)
    text = dump(kept)
    again = parse(text, "corrections.toml")
    assert again == tuple(kept)
    assert dump(again) == text
    assert digest(again, KINDS) == digest(kept, KINDS)


LOG = """format = 1

[[correction]]
kind = "same"
time = 2026-11-22T11:32:09Z
places = [
    [3, 1.0, 2.0, 0.8],
    [9, 1.2, 2.0, 0.8],
]

[[correction]]
kind = "here"
time = 2026-11-22T11:32:09Z
places = [[3, 5.0, 2.0, 0.8]]
"""


def test_what_is_added_and_taken_back_leaves_the_log_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / FILE
    write_log(path, parse(LOG, "log"))
    before = path.read_bytes()
    added = make(kind="name", places=[[3, 5.0, 2.0, 0.8]], name="Anna")
    write_log(path, (*read_log(path), added))
    assert [one.id for one in read_log(path)][-1] == added.id
    write_log(path, [one for one in read_log(path) if one.id != added.id])
    assert path.read_bytes() == before


SAME = LOG[LOG.index("[[correction]]") : LOG.rindex("[[correction]]")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LOG + "places\n", "expected TOML"),
        (LOG.replace('"here"', '"hear"'), "line 12: kind: expected one of same, .* found 'hear'"),
        (LOG.replace("[[3, 5.0", "[[-3, 5.0"), "line 14: places: a step is a whole number"),
        (LOG + "accuracy = 9.0\n", "line 15: accuracy"),
        (LOG + "size = 1\n", "line 15: size"),
        (LOG.replace("places = [[3", "at = [[3"), "line 1[14]: (at|places)"),
        (LOG.replace("[9, 1.2", "[2, 1.2"), "line 6: places: same goes forward in time"),
        (LOG.replace("format = 1", "format = 1\nstrange = 2"), "line 2: expected format"),
        (LOG.replace("format = 1", "# a word\nformat = 3"), "line 2: expected format = 1, found 3"),
        ("format = 1\ncorrection = 3\n", r"line 2: expected tables \[\[correction"),
        (LOG.replace("time =", 'id = "a"\ntime ='), "line 12: id: .* found a again"),
        ('correction = [{kind = "hear"}]', "line 1: kind: expected one of same, .* found 'hear'"),
        (LOG + "\n" + SAME.replace("same", "different"), "line 16: .* contradicts"),
        ("a = " + "[" * 3000, "expected a few levels"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(text: str, message: str) -> None:
    assert parse(LOG, "log")
    with pytest.raises(CorrectionError, match=f"^log[,:] {message}"):
        parse(text, "log")


def test_a_log_is_a_file_of_text_or_not_there(tmp_path: Path) -> None:
    path = tmp_path / FILE
    assert read_log(path) == ()
    path.mkdir()
    with pytest.raises(CorrectionError, match="expected a file, found a folder"):
        read_log(path)
    path.rmdir()
    path.write_bytes(b"\xef\xbb\xbf" + LOG.encode())
    assert read_log(path) == parse(LOG, "log")
    path.write_bytes(LOG.encode() + b"# \xff")
    with pytest.raises(CorrectionError, match=r"corrections\.toml, line 15"):
        read_log(path)


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(tmp_path / "cache"))
    return tmp_path / "settings" / "corrections"


def test_the_log_of_a_built_in_room_lies_under_its_name_in_the_settings(settings: Path) -> None:
    folder = ROOMS / "room44-3p"
    assert place_of(folder) == writing_place(folder) == settings / "room44-3p.toml"
    assert remark_on(folder) is None


def test_a_log_made_on_a_room_as_it_was_rendered_counts_with_a_remark_until_one_is_added(
    settings: Path, tmp_path: Path
) -> None:
    rendered = tmp_path / "cache" / "rooms" / "version-4" / "room44-3p-2-cameras"
    rendered.mkdir(parents=True)
    earlier = place_of(rendered)  # as an earlier version of the program found it
    write_log(earlier, parse(LOG, "log"))
    before = earlier.read_bytes()
    folder = ROOMS / "room44-3p"
    log = open_log(folder)
    assert (log.path, len(log.corrections)) == (earlier, 2)
    assert "as it was rendered before" in str(remark_on(folder))
    assert remark_on(rendered) is None
    assert open_log(ROOMS / "room24-2p").corrections == ()
    added = (*log.corrections, make(kind="name", places=[[3, 5.0, 2.0, 0.8]], name="Anna"))
    write_log(writing_place(folder), added)
    assert open_log(folder).corrections == added
    assert remark_on(folder) is None
    assert earlier.read_bytes() == before


def test_who_is_tied_together_is_not_parted() -> None:
    a, b, c = [3, 1.0, 2.0, 0.8], [9, 1.2, 2.0, 0.8], [20, 3.0, 2.0, 0.8]
    one, other = make(kind="same", places=[a, b]), make(kind="same", places=[b, c])
    for parted in (make(kind="different", places=[a, c]), make(kind="different", places=[a, b])):
        with pytest.raises(CorrectionError, match="contradicts"):
            refuse_contradiction([one, other], parted)
        with pytest.raises(CorrectionError, match="contradicts"):
            refuse_contradiction([parted, one], other if parted.places[1].step == 20 else one)
    refuse_contradiction([one], make(kind="different", places=[a, c]))
    named = make(kind="name", places=[a], name="Anna")
    with pytest.raises(CorrectionError, match='contradicts "same person'):
        refuse_contradiction([one, named], make(kind="different", places=[a, b]))
    far = [9, 9.0, 2.0, 0.8]
    with pytest.raises(CorrectionError, match="two places"):
        refuse_contradiction([one], make(kind="same", places=[a, far]))
    with pytest.raises(CorrectionError, match="a person is at"):
        refuse_contradiction([make(kind="here", places=[a])], make(kind="nobody", places=[a]))


def test_whoever_is_moved_again_is_where_it_was_said_last() -> None:
    found, first, second = (30, 1.0, 2.0, 0.9), (30, 2.5, 2.0, 0.9), (30, 2.5, 3.5, 0.9)
    one = make(kind="here", places=[first, found])
    again = make(kind="here", places=[second, (30, 2.6, 2.0, 0.9)])
    old, new = find_repeated([one], again)
    assert old is one
    assert new.places == again.places[:1] + one.places[1:]
    begun = make(kind="here", places=[first])  # nobody was there before
    assert find_repeated([begun], again)[1].places == again.places[:1]
    for other in (
        make(kind="here", places=[second, found]),  # where another was
        make(kind="here", places=[(31, *second[1:]), (31, *first[1:])]),
        make(kind="here", places=[second]),
    ):
        assert find_repeated([one], other) == (None, other)


def test_two_logs_as_one() -> None:
    first = parse(LOG, "one")
    later = make(kind="checked", first=0, last=9, time=datetime(2020, 1, 1, tzinfo=UTC))
    second = (first[0], later)
    told = difference(first, second)
    assert (told.only_first, told.only_second, told.changed) == ((first[1],), (later,), ())
    assert next(one.id for one in merge(first, second)) == later.id
    assert set(merge(first, second)) == set(merge(second, first)) == {*first, later}
    changed = first[0].model_copy(update={"note": "look again"})
    with pytest.raises(CorrectionError, match="same in both logs"):
        merge(first, (changed,))
    assert difference(first, first).empty


def test_what_two_logs_both_say_counts_once() -> None:
    said = {"kind": "same", "places": [[3, 1.0, 2.0, 0.8], [9, 1.2, 2.0, 0.8]]}
    earlier = make(**said, time=datetime(2026, 11, 22, tzinfo=UTC))
    later = make(**said, time=datetime(2026, 11, 23, tzinfo=UTC), note="so they are")
    assert earlier.id != later.id
    assert merge((later,), (earlier,)) == merge((earlier,), (later,)) == (earlier,)


def test_two_logs_that_give_one_person_two_names_are_not_merged() -> None:
    def named(name: str, step: int, x: float) -> Correction:
        return make(kind="name", places=[[step, x, 2.0, 0.8]], name=name)

    anna, bob = named("Anna", 3, 1.0), named("Bob", 3, 1.1)
    with pytest.raises(CorrectionError, match=r'"Anna, step 3" .* "Bob, step 3" .* one person'):
        merge((anna,), (bob,))
    # they are one person by what one of the logs says
    later = named("Bob", 9, 1.2)
    same = make(kind="same", places=[[3, 1.0, 2.0, 0.8], [9, 1.2, 2.0, 0.8]])
    with pytest.raises(CorrectionError, match="one person"):
        merge((anna, same), (later,))
    assert set(merge((anna,), (later,))) == {anna, later}
    # within a log the later name counts
    assert set(merge((anna, bob), (anna, bob))) == {anna, bob}


@pytest.mark.parametrize("target", ["/etc/passwd", "/dev/zero", "corrections.toml"])
def test_a_link_out_of_the_folder_is_neither_read_nor_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / FILE).symlink_to(target)
    assert open_log(folder).path == own_place(folder)
    assert writing_place(folder) == own_place(folder)
    assert open_log(folder).problem is None


def test_a_link_within_the_folder_is_followed(tmp_path: Path) -> None:
    (tmp_path / "kept.toml").write_text(LOG, encoding="utf-8")
    (tmp_path / FILE).symlink_to("kept.toml")
    assert writing_place(tmp_path) == tmp_path / FILE
    assert open_log(tmp_path).corrections == parse(LOG, "log")


def test_a_malformed_log_is_reported_and_empty(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(LOG.replace("format = 1", "format = 2"), encoding="utf-8")
    with pytest.raises(CorrectionError, match="line 1") as error:
        read_log(tmp_path / FILE)
    opened = open_log(tmp_path)
    assert (opened.corrections, opened.problem) == ((), str(error.value))


def test_what_was_said_while_a_folder_could_not_be_written_to_counts_afterwards(
    settings: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "recording"
    folder.mkdir()
    told = parse(LOG, "log")
    write_log(folder / FILE, told[:1])
    own = own_place(folder)
    write_log(own, told)  # as the workbench does when the folder refuses
    assert (place_of(folder), writing_place(folder)) == (own, folder / FILE)
    assert remark_on(folder) is None
    write_log(folder / FILE, told[1:])  # another program
    os.utime(own, (1.0, 1.0))
    assert place_of(folder) == folder / FILE
    assert str(own) in str(remark_on(folder))


@pytest.mark.parametrize(
    ("beside", "own", "read_only", "at_own"),
    [
        # the time of each file, None where it is not there
        (None, None, False, False), (None, None, True, True), (1.0, None, False, False),
        (1.0, None, True, False), (None, 1.0, False, True), (None, 1.0, True, True),
        (2.0, 1.0, False, False), (1.0, 2.0, False, True), (1.0, 1.0, False, True),
        (2.0, 1.0, True, True),
    ],
)  # fmt: skip
def test_the_log_that_was_written_last_counts_and_of_a_folder_that_is_read_the_users(
    settings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    beside: float | None, own: float | None, read_only: bool, at_own: bool,
) -> None:  # fmt: skip
    folder = tmp_path / "recording"
    folder.mkdir()
    for path, time in ((folder / FILE, beside), (own_place(folder), own)):
        if time is not None:
            write_log(path, parse(LOG, "log"))
            os.utime(path, (time, time))
    monkeypatch.setattr("os.access", lambda path, mode: not read_only)
    assert place_of(folder) == (own_place(folder) if at_own else folder / FILE)
    assert writing_place(folder) == (own_place(folder) if read_only else folder / FILE)


def test_a_log_is_read_up_to_its_largest_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FILE).write_text(LOG, encoding="utf-8")
    size = len(LOG.encode())
    monkeypatch.setattr("tracker.corrections.log._MOST_BYTES", size)
    assert len(read_log(tmp_path / FILE)) == 2
    monkeypatch.setattr("tracker.corrections.log._MOST_BYTES", size - 1)
    with pytest.raises(CorrectionError, match="expected a log of at most 0 MB, found 0 MB"):
        read_log(tmp_path / FILE)


def test_a_log_is_written_as_people_write_it() -> None:
    when = datetime(2026, 11, 22, 11, 32, 9)  # without a zone
    told = [one.model_copy(update={"time": when}) for one in parse(LOG, "log")]
    here = told[1].model_copy(update={"note": "", "places": (told[1].places[0],)})
    text = dump([told[0], here])
    kept = [line for line in text.splitlines() if line and not line.startswith(("#", "id"))]
    expected = f"{LOG}accuracy = 0.1".splitlines()
    assert sorted(kept) == sorted(line for line in expected if line)
    assert dump([]).splitlines()[-1] == "format = 1"

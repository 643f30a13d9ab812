"""Each reader under a fuzzer that follows which branches are taken (atheris, where it is there).

``python3 -m tests.fuzz.coverage_guided READER SECONDS``; without a reader, their names. What is
no sentence ends it with the input that led there, in ``crash-*`` beside the corpus of the run.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

from tracker import kernels

Reader = Callable[[Path, bytes], None]


def table(folder: Path, data: bytes) -> None:
    """A table of boxes."""
    from tracker.sequences.csv_columns import read_columns

    path = folder / "case.csv"
    path.write_bytes(data)
    read_columns(path, "case", needed=("frame", "left"), optional={"score": 1.0}, blank=("left",))


def track_file(folder: Path, data: bytes) -> None:
    """A file of tracks."""
    from tracker.export import read_tracks_csv

    path = folder / "case.csv"
    path.write_bytes(data)
    read_tracks_csv(path)


def toml(folder: Path, data: bytes) -> None:
    """A sequence's own file."""
    from tracker.sequences.reader import FILE, read_sequence, read_summary

    (folder / FILE).write_bytes(data)
    read_summary(folder)
    read_sequence(folder)


def video(folder: Path, data: bytes) -> None:
    """A video."""
    from tracker.sequences.pictures.video import VideoDecoder, index_video

    path = folder / "case.mp4"
    path.write_bytes(data)
    with VideoDecoder(index_video(path)) as decoder:
        decoder.read(0)


def picture(folder: Path, data: bytes) -> None:
    """An image."""
    from tracker.sequences.pictures.video import read_image

    path = folder / "case.jpg"
    path.write_bytes(data)
    read_image(path)


def foreign(folder: Path, data: bytes) -> None:
    """A file of another program, of any format."""
    from tracker.importing.gathering import gather

    suffix = ("json", "xml", "yml", "toml", "csv", "txt", "npy", "mat", "bin")[len(data) % 9]
    path = folder / f"case.{suffix}"
    path.write_bytes(data)
    gather([path])
    path.unlink()


READERS: dict[str, Reader] = {
    one.__name__: one for one in (table, track_file, toml, video, picture, foreign)
}


def seeds(folder: Path) -> Path:
    """Good files to begin with."""
    from tests.fuzz.cases import make_bases

    corpus = folder / "corpus"
    corpus.mkdir()
    for base in make_bases(folder / "bases").values():
        for path in base.rglob("*"):
            if path.is_file() and path.stat().st_size < 2**16:
                (corpus / f"{base.name}-{path.name}").write_bytes(path.read_bytes())
    return corpus


def tried(reader: Reader, folder: Path, data: bytes) -> None:
    """Read once; a sentence is what is wanted."""
    from tracker.formats.pieces import FormatError
    from tracker.sequences.pictures.video import VideoError
    from tracker.sequences.sequence import SequenceError

    try:
        reader(folder, data)
    except (SequenceError, FormatError, VideoError) as error:
        if not str(error).isprintable() or len(str(error)) > 2000:
            raise AssertionError(f"a poor sentence: {str(error)[:300]!r}") from None


def main() -> int:
    """Fuzz one reader for some seconds."""
    if len(sys.argv) != 3 or sys.argv[1] not in READERS:
        print(f"usage: python3 -m tests.fuzz.coverage_guided {'|'.join(READERS)} SECONDS")
        return 2
    reader, seconds = READERS[sys.argv[1]], sys.argv[2]
    try:
        import atheris
    except ImportError:
        print("atheris is not installed: nothing was run")
        return 0
    with tempfile.TemporaryDirectory(prefix="multiview-phd-fuzz-") as place:
        work = Path(place) / "case"
        work.mkdir()
        # the kernels are compiled from their bytecode, which must stay as it is: they come first
        for module in pkgutil.walk_packages(kernels.__path__, f"{kernels.__name__}."):
            importlib.import_module(module.name)
        with atheris.instrument_imports(include=["tracker"]):
            tried(reader, work, b"")
        corpus = seeds(Path(place))
        words = [sys.argv[0], f"-max_total_time={seconds}", "-rss_limit_mb=4096", "-timeout=10"]
        words += [f"-seed={Random().randrange(1, 2**31)}", str(corpus)]
        atheris.Setup(words, lambda data: tried(reader, work, data))
        atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())

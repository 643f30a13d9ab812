"""Every form that tracks leave in, once: the command line, the page and the manual list these."""

from __future__ import annotations

import importlib
import shutil
from dataclasses import dataclass
from pathlib import Path

from tracker.export.written import Options, Written
from tracker.files.atomic import filling, replacing, zip_folder
from tracker.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True)
class Format:
    """One form."""

    name: str
    """As ``--format`` takes it."""
    word: str
    """As a person reads it."""
    suffix: str
    """By which it is chosen; empty for a folder."""
    help: str
    module: str
    """Has ``write(path, written, options)``."""
    media: str
    needs_package: str = ""
    """Beside the program."""
    extra: str = ""
    """That installs it."""
    needs_truth: bool = False
    needs_pictures: bool = False

    def check(self, sequence: Sequence) -> None:
        """Whether runs of a sequence can be written in this form, before any work is done for it.

        Raises:
            ValueError: If the sequence has not what it needs, or a package is not installed.
        """
        if self.needs_truth and sequence.ground_truth is None:
            raise ValueError(
                f"{self.word}: {sequence.name} has no truth that tracks could be set against; name "
                "its file in [ground_truth] of sequence.toml, or choose another format"
            )
        if self.needs_pictures and not any(view.has_pictures for view in sequence.views):
            raise ValueError(f"{self.word}: {sequence.name} has no pictures to make a video of")
        if self.needs_package:
            try:
                importlib.import_module(self.needs_package)
            except ImportError:
                raise ValueError(
                    f"{self.word} needs {self.needs_package}, which is not installed: "
                    f'pip install "multiview-phd[{self.extra}]"'
                ) from None

    @property
    def folder(self) -> bool:
        """Whether it is a folder of files."""
        return not self.suffix


FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        Format("csv", "CSV", ".csv", "one row a person a step, with boxes", "csv_file", "text/csv"),
        Format(
            "motchallenge", "MOTChallenge", "", "a text a camera, in TrackEval's folders",
            "motchallenge", "application/zip",
        ),
        Format(
            "json", "JSON", ".json", "tracks and parameters, by tracks.schema.json",
            "json_file", "application/json",
        ),
        Format(
            "parquet", "Parquet", ".parquet", "one table in full precision", "parquet",
            "application/vnd.apache.parquet", "pyarrow", "parquet",
        ),
        Format("trc", "TRC", ".trc", "a marker a person, for OpenSim", "trc", "text/plain"),
        Format(
            "gltf", "glTF", ".glb", "boxes that move, for Blender and viewers of 3D", "gltf",
            "model/gltf-binary",
        ),
        Format(
            "rerun", "Rerun", ".rrd", "a recording for Rerun's viewer", "rerun_file",
            "application/octet-stream", "rerun", "rerun",
        ),
        Format(
            "html", "HTML report", ".html", "figures and differences against the truth, one file",
            "report", "text/html", needs_truth=True,
        ),
        Format(
            "mp4", "MP4", ".mp4", "cameras with boxes, the room from above, lanes", "video.film",
            "video/mp4", needs_pictures=True,
        ),
    )
}  # fmt: skip
"""By name; CSV is what is written where nothing else is asked for."""


def format_of(path: Path, name: str | None = None) -> Format:
    """The form of a file by its name or, where none is given, its suffix; CSV where that says
    nothing.

    Raises:
        ValueError: If there is no such form, or the suffix is the name of one that has another.
    """
    if name is not None:
        if name not in FORMATS:
            raise ValueError(f"expected one of {', '.join(FORMATS)}, got {name!r}")
        return FORMATS[name]
    for form in FORMATS.values():
        if form.suffix and path.suffix.lower() == form.suffix:
            return form
    meant = FORMATS.get(path.suffix.lower().removeprefix("."))
    if meant is not None and meant.suffix:
        raise ValueError(
            f"expected a name that ends in {meant.suffix} for {meant.word}, got {path.name!r}"
        )
    return meant or FORMATS["csv"]


def save(
    path: Path,
    form: Format,
    written: Written,
    options: Options | None = None,
    *,
    zipped: bool = False,
) -> None:
    """Write a run in one of the forms: wholly or not at all, whatever interrupts it.

    Args:
        path: A file, replaced if it is there; or a folder, which must be new or empty.
        form: Of :data:`FORMATS`.
        written: The run.
        options: How much; all, if none are given.
        zipped: A folder as one ZIP file.

    Raises:
        ValueError: If the run has not what the form needs, or a package is not installed.
        OSError: With a sentence, if it cannot be written.
        Stopped: If it is not wanted any more.
    """
    options = options or Options()
    form.check(written.sequence)
    module = importlib.import_module(f"tracker.export.{form.module}")
    if not form.folder:
        if not path.is_dir() and path.exists() and not path.is_file():
            module.write(path, written, options)  # a pipe or device
            return
        with replacing(path) as temporary:
            module.write(temporary, written, options)
    elif zipped:
        with replacing(path) as temporary:
            folder = temporary.with_name(temporary.name + ".folder")
            folder.mkdir()
            try:
                module.write(folder, written, options)
                zip_folder(folder, temporary)
            finally:
                shutil.rmtree(folder, ignore_errors=True)
    else:
        with filling(path) as temporary:
            module.write(temporary, written, options)

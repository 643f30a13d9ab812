"""The table of all export formats, which the command line, the page and the manual list."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from tracker.export import gltf, json_file, motchallenge, parquet, rerun_file, tracks_csv, trc
from tracker.export.exported_run import ExportedRun, Options
from tracker.files.atomic import new_folder, replacing, zip_folder
from tracker.sequences.reader import WHERE_NOW, why_missing
from tracker.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True)
class Format:
    """One export format."""

    name: str
    """The value of ``--format``."""
    word: str
    """The name that is displayed."""
    suffix: str
    """The suffix of a file, by which the format is chosen; empty if the format is a folder."""
    help: str
    """The content of the file, in a few words."""
    write: Callable[[Path, ExportedRun, Options], None]
    """The function that writes a run to a new file, or into an empty folder."""
    media: str
    """The media type (MIME type) of the file."""
    needs_package: str = ""
    """A package that the format needs and that is not installed with the program; empty for
    none."""
    extra: str = ""
    """The extra of the program's package that installs this package; empty for none."""
    needs_recording: bool = False
    """Whether the cameras and the room of the recording are needed, or the size of a target."""
    needs_truth: bool = False
    """Whether the sequence must have ground truth."""
    needs_pictures: bool = False
    """Whether a camera of the sequence must have pictures."""

    def check(self, sequence: Sequence) -> None:
        """Check that runs of a sequence can be written in this format, before any work is done.

        Raises:
            ValueError: If the sequence lacks what the format needs, or a package is not installed.
        """
        if not sequence.views and (self.needs_recording or self.needs_truth or self.needs_pictures):
            why = why_missing(sequence.folder)
            raise ValueError(
                f"{self.word} needs the recording, and {why}: {WHERE_NOW}, or write CSV, JSON, "
                "Parquet or TRC"
            )
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
        """Whether the format is a folder of files."""
        return not self.suffix


def _write_report(path: Path, run: ExportedRun, options: Options) -> None:
    """Evaluate the tracks against the sequence's ground truth, and write the report."""
    from tracker.evaluation import evaluate_sequence
    from tracker.evaluation.report.page import report_html  # imports plotly

    evaluation = evaluate_sequence(run.sequence, run.tracks, steps=run.steps)
    text = report_html(
        run.sequence, run.tracks, run.parameters, evaluation, seed=run.seed, back=run.back
    )
    path.write_text(text, encoding="utf-8")
    options.at(run.steps, run.steps)


def _write_video(path: Path, run: ExportedRun, options: Options) -> None:
    from tracker.export import video  # imports OpenCV and the reading of videos

    video.write(path, run, options)


FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        Format(
            "csv", "CSV", ".csv", "one row a person a step, with boxes",
            tracks_csv.write, "text/csv",
        ),
        Format(
            "motchallenge", "MOTChallenge", "", "a text a camera, in TrackEval's folders",
            motchallenge.write, "application/zip", needs_recording=True,
        ),
        Format(
            "json", "JSON", ".json", "tracks and parameters, by tracks.schema.json",
            json_file.write, "application/json",
        ),
        Format(
            "parquet", "Parquet", ".parquet", "one table in full precision",
            parquet.write, "application/vnd.apache.parquet", "pyarrow", "parquet",
        ),
        Format(
            "trc", "TRC", ".trc", "a marker a person, for OpenSim", trc.write, "text/plain"
        ),
        Format(
            "gltf", "glTF", ".glb", "boxes that move, for Blender and viewers of 3D",
            gltf.write, "model/gltf-binary", needs_recording=True,
        ),
        Format(
            "rerun", "Rerun", ".rrd", "a recording for Rerun's viewer",
            rerun_file.write, "application/octet-stream", "rerun", "rerun",
            needs_recording=True,
        ),
        Format(
            "html", "HTML report", ".html", "figures and differences against the truth, one file",
            _write_report, "text/html", needs_truth=True,
        ),
        Format(
            "mp4", "MP4", ".mp4", "cameras with boxes, the room from above, lanes",
            _write_video, "video/mp4", needs_pictures=True,
        ),
    )
}  # fmt: skip
"""The formats by name; CSV is the default."""


def format_of(path: Path, name: str | None = None) -> Format:
    """Choose the format of a file.

    Args:
        path: The file. If no name is given, its suffix chooses the format, and a name without a
            suffix chooses CSV.
        name: The name of the format; None if the suffix chooses it.

    Raises:
        ValueError: If there is no format of this name or suffix, or the suffix is the name of a
            format whose files have another suffix (``.gltf``).
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
    if meant is None and path.suffix:
        known = ", ".join(form.suffix for form in FORMATS.values() if form.suffix)
        raise ValueError(
            f"{path.name}: expected a name that ends in one of {known}, got {path.suffix!r}; "
            "rename it, or choose the format by --format"
        )
    return meant or FORMATS["csv"]


def save(
    path: Path,
    form: Format,
    run: ExportedRun,
    options: Options | None = None,
    *,
    zipped: bool = False,
) -> None:
    """Write a run in one of the formats, atomically.

    Args:
        path: The file to write, which is replaced if it exists; or the folder, which must be new or
            empty.
        form: The format, one of :data:`FORMATS`.
        run: The run to write.
        options: The range of steps and the callbacks; if None, the whole run without callbacks.
        zipped: Whether a format that is a folder is written as one ZIP file.

    Raises:
        ValueError: If the run lacks what the format needs, or a package is not installed.
        OSError: If the file cannot be written; the message says why.
        Stopped: If the caller cancelled the export.
    """
    options = replace(options or Options(), name=path.name)
    form.check(run.sequence)
    if not form.folder:
        with replacing(path) as temporary:
            form.write(temporary, run, options)
    elif zipped:
        with replacing(path) as temporary, tempfile.TemporaryDirectory() as folder:
            form.write(Path(folder), run, options)
            zip_folder(Path(folder), temporary)
    else:
        with new_folder(path) as temporary:
            form.write(temporary, run, options)

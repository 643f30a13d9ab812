"""The table: of each kind of file, each damage with the sentence that refuses it.

``table.toml`` has a section for each kind of :mod:`tests.bad_input.kinds`. Its keys are the damages
that can be done to any file, or names of other files that stand in its place; ``edits`` are changes
of its text, from one text to another (an empty first one is the whole file). A sentence stands
there in full, but for ``…``, which is any text, and FOLDER; an empty sentence means that the file
is taken as it is.
"""

from __future__ import annotations

import io
import re
import sqlite3
import stat
import struct
import tomllib
import zipfile
import zlib
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tests.bad_input.damage import OF_A_FILE
from tracker.library import schema

ROWS = 8
"""Of the table that appearance vectors belong to."""


def array(values: ArrayLike) -> bytes:
    """A file as ``numpy.save`` writes it."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(values))
    return stream.getvalue()


def archive(name: str | zipfile.ZipInfo, text: str) -> bytes:
    """A ZIP archive with one file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr(name, text)
    return stream.getvalue()


def database(statements: str) -> bytes:
    """An SQLite database after some statements."""
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(statements)
        return connection.serialize()


def link(name: str) -> zipfile.ZipInfo:
    found = zipfile.ZipInfo(name)
    found.external_attr = (stat.S_IFLNK | 0o777) << 16
    return found


def zeros_packed(megabytes: int) -> bytes:
    """So many zeros as zlib packs them: one piece over and over, with the sum of all."""
    million = bytes(1_000_000)
    packer = zlib.compressobj(9)
    first, again = (packer.compress(million) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    adler = ((1_000_000 * megabytes % 65521) << 16) + 1
    return first + again * (megabytes - 1) + b"\x03\x00" + struct.pack(">I", adler)


PACKED = zeros_packed(100)
LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(12))
    + "]><opencv_storage><K>&m;</K></opencv_storage>"
)

FOREIGN: dict[str, bytes] = {
    "laughs.xml": LAUGHS.encode(),
    "outside.xml": b'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    b"<opencv_storage><K>&x;</K></opencv_storage>",
    "deep.json": b'{"people":' + b"[" * 200_000,
    "deep.xml": b"<opencv_storage>" + b"<a>" * 100_000,
    "deep.yml": b"%YAML:1.0\n---\nK: " + b"[" * 20_000,
    "laughs.yml": b"%YAML:1.0\n---\na: &a [1,1]\nK: [" + b"*a," * 1000 + b"*a]\n",
    "tag.yml": b"%YAML:1.0\n---\nK: !!python/object/apply:os.system [true]\n",
    "deep.toml": b"[cam_1]\nmatrix = " + b"[" * 50_000 + b"\ndistortions = []",
    "cut.json": b'[{"image_id": 3, "category_id": 1, "bbox": [1, 2,',
    "cut.xml": b"<?xml version='1.0'?><opencv_storage><camera_matrix type_id='opencv-matrix'><r",
    "cut.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }",
    "claims.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, "
    b"'shape': (999999999999, 3, 4), }" + b" " * 10 + b"\n",
    "pickled.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, "
    b"'shape': (3, 4), }" + b" " * 33 + b"\n" + b"cos\nsystem\n(S'true'\ntR.",
    "binary.csv": b"frame,left,top,width,height\n" + bytes(range(128, 192)) + b"\0",
    "digits.json": b'[{"image_id": ' + b"9" * 10_000 + b', "bbox": [1,2,3,4], "score": 1}]',
    "infinite.csv": b"frame,left,top,width,height\n0,nan,inf,3,4\n1e400,1,2,3,4\n",
    "fractions.csv": b"frame,left,top,width,height\n0.5,1,2,3,4\n",
    "short.csv": b"frame,left,top,width,height\n0,1,2\n",
    "fake.mp4": b"\0\0\0\x18ftypisom" + b"\0" * 500,
    "fake.mat": b"MATLAB 5.0 MAT-file" + b" " * 200,
    "open.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, "
    b"'shape': (3, 4" + b" " * 58 + b"\n",
    "long.toml": b"[cam_1]\nmatrix = [[" + b"9" * 5000 + b"]]\n",
    "long.json": b'{"boxes": [{"frame": 1, "box": [1, 2, ' + b"9" * 400 + b", 4]}]}",
    "returns.csv": b'frame,time\n0,0.0\r\r0,"1\r1.0\n',
    "0.txt": b"0 0.5 0.5 0.1 0.2\n0 0.50.5 0.1 0.2 0.3\n0 0.5 0.5 0.1 0.2\n",
    "huge.json": b'{"sfm_data_version": "0.3", "views": [], "intrinsics": [], "extrinsics": '
    b'[{"key": 0, "value": {"rotation": [[1e308, 1e308, 0], [1e308, 1, 0], [0, 0, 1]], '
    b'"center": [0, 0, 1]}}]}',
    "names.json": b'{"cam1": {"K' + b"_" * 200_000 + b'": [1, 0, 0, 0, 1, 0, 0, 0, 1]}}',
    "names.txt": b"K" + b"_" * 200_000 + b" 1 0 0 0 1 0 0 0 1\n",
    "images.bin": struct.pack("<QI7dI", 2**31, 1, 1, 0, 0, 0, 0, 0, 0, 1) + b"a\0" + b"\xff" * 99,
    "utf-16.xml": (
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "' + "c" * 500 + '">]>'
        "<opencv_storage><K>&b;</K></opencv_storage>"
    ).encode("utf-16"),
    "half.csv": b"\xff\xfef\x00r\x00\x00\xd8",
    "huge.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[1e308, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [0, 0, 3]\n",
    "far.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [1e308, 0, 3]\n",
    "turned.toml": b"[cam_1]\nsize = [640, 480]\n"
    b"matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    b"distortions = [0, 0, 0, 0]\nrotation = [1e300, 0, 0]\ntranslation = [0, 0, 3]\n",
    "flat.txt": b"1 2 3 4\n2 4 6 8\n1 1 1 1\n",
    "nowhere.txt": b"0 0 0 0\n0 0 0 0\n0 0 0 0\n",
    "named.json": b'{"' + b"c" * 5000 + b'": {"K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], '
    b'"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 3], "image_size": [640, 480]}}',
    "lines.csv": b"frame,left,top,width,height\n" + b"\n" * 10_000_001,
    "cut.npz": b"PK\x03\x04" + bytes(300),
    "session.zip": b"PK\x05\x06" + bytes(18),
    "empty.json": b"",
    "empty.xml": b"",
    "bomb.mat": b"MATLAB 5.0 MAT-file".ljust(124)
    + b"\x00\x01IM"
    + struct.pack("<II", 15, len(PACKED))
    + PACKED,
    "calibration.pickle": b"\x80\x04K\x01.",
    "cam1.csv": b"scorer,net\nbodyparts,nose\n",
    "0.jpg": b"\xff\xd8\xff\xe0" + bytes(60),
}
"""Files of other programs, by the names under which they lie in a folder to import."""


SPOILT = archive("run.json", "{}" * 5000)  # within what is compressed

CONTENTS: dict[str, bytes] = {
    "a playlist": b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\ncam2.mp4\n#EXT-X-ENDLIST\n",
    "a list of files": b"ffconcat version 1.0\nfile cam2.mp4\n",
    "a stream": b"v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\n"
    b"m=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
    "references": b"<asx version='3.0'><entry><ref href='cam2.mp4'/></entry></asx>",
    "text": b"nothing of the kind, but long enough to be taken for it " * 20,
    "zeros": bytes(500),
    "a row too few": array(np.zeros((ROWS - 1, 4))),
    "one number a row": array(np.zeros(ROWS)),
    "whole numbers": array(np.zeros((ROWS, 4), dtype=np.int64)),
    "no columns": array(np.zeros((ROWS, 0))),
    "objects": array(np.array([["a"] * 3] * ROWS, dtype=object)),
    "nan": array(np.where(np.arange(ROWS) == 5, np.nan, 1.0)[:, None]),
    "inf": array(np.full((ROWS, 2), np.inf)),
    "other vectors": array(np.ones((ROWS, 5))),
    "a header alone": b"\x93NUMPY\x01\x00",
    "code": b"\x93NUMPY\x01\x00\x10\x00{'descr': __im}",
    "another database": database("CREATE TABLE bookmarks (a)"),
    "a newer version": database(
        f"PRAGMA application_id = {schema.APPLICATION_ID};"
        f"PRAGMA user_version = {schema.VERSION + 1};"
    ),
    "another archive": archive("holiday.jpg", ""),
    "another format": archive("run.json", '{"format": 99}'),
    "a spoilt archive": SPOILT[:45] + b"\xff" * 5 + SPOILT[50:],
    "a link inside": archive(link("sequence"), "/etc"),
    **{
        f"a path {name}": archive(name, "evil")
        for name in ("../evil.txt", "/evil.txt", "a/../../evil.txt", "..\\evil.txt", "C:/evil.txt")
    },
}
"""Files in the place of one of the same name."""


TABLE = Path(__file__).with_name("table.toml")


@dataclass(frozen=True, slots=True)
class Row:
    """One file, one damage, one sentence."""

    kind: str
    file: str
    """The file that is damaged, in its folder."""
    damage: str
    """What is done to it: one of :mod:`tests.bad_input.damage`, a name of
    :mod:`tests.bad_input.table`, or ``edit`` for a change of its text."""
    sentence: str
    """Empty where the file is taken as it is."""
    old: str | None = None
    new: str | None = None

    def apply(self, folder: Path) -> Path:
        """Do the damage in a folder; the file's path."""
        path = folder / self.file
        if self.new is not None:
            text = path.read_text(encoding="utf-8")
            assert str(self.old) in text, f"{self.old} is not in {self.file}"
            changed = text.replace(str(self.old), self.new, 1) if self.old else self.new
            path.write_text(changed, encoding="utf-8")
        elif self.damage in OF_A_FILE:
            OF_A_FILE[self.damage](path, 0.5, 0)
        else:
            path.write_bytes({**CONTENTS, **FOREIGN}[self.damage])
        return path

    def __str__(self) -> str:
        what = self.damage if self.new is None else f"{self.old} → {self.new}"
        return f"{self.kind}: {what}"[:60].encode("ascii", "replace").decode()

    def matches(self, sentence: str, folder: Path) -> bool:
        """Whether a sentence is the row's, for files that lie in a folder."""
        return re.fullmatch(self._pattern(folder), sentence) is not None

    def is_in(self, words: str, folder: Path) -> bool:
        """Whether a longer sentence, which may begin with a capital letter, holds the row's."""
        return re.search(self._pattern(folder), words, re.IGNORECASE) is not None

    def _pattern(self, folder: Path) -> str:
        expected = re.escape(self.sentence).replace("…", ".*")
        return re.sub(r"\bFOLDER", lambda _: re.escape(str(folder)), expected)


def _repeated(text: str) -> str:
    """A text in which ``{x*400}`` stands for 400 times x."""
    return re.sub(r"\{([^{}]+)\*(\d+)\}", lambda found: found[1] * int(found[2]), text)


@cache
def rows() -> tuple[Row, ...]:
    """All of them, in the order of the file."""
    found: list[Row] = []
    for kind, section in tomllib.loads(TABLE.read_text(encoding="utf-8")).items():
        file, edits = section.pop("file", ""), section.pop("edits", [])
        found += [Row(kind, file or damage, damage, said) for damage, said in section.items()]
        found += [
            Row(kind, file, "edit", said, _repeated(old), _repeated(new))
            for old, new, said in edits
        ]
    return tuple(found)

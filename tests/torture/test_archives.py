"""Archives made to harm whoever opens them: pickles, names of other folders, gigabytes of zeros."""

from __future__ import annotations

import io
import pickle
import zipfile

import numpy as np
import pytest
from fuzz.findings import Trial, judged_apart
from fuzz.seeds import AROUND_A_MATRIX

from circuitkit.circuit import check


class Writes:
    """A pickle of it writes a file when it is read."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def array(header, data=b""):
    """A file of numpy with any header."""
    text = f"{header}\n".encode().rjust(118, b" ")
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def archive(files):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, data in files.items():
            zipped.writestr(name, data)
    return file.getvalue()


def of_zeros(n):
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (n, n)})
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as zipped, zipped.open("w.npy", "w") as inner:
        inner.write(file.getvalue())
        for _ in range(n * n * 8 >> 20):
            inner.write(bytes(1 << 20))
    return packed.getvalue()


OBJECTS = "{'descr': '|O', 'fortran_order': False, 'shape': (3, 3), }"
HARMFUL = {
    "a pickle": lambda path: archive({"w.npy": array(OBJECTS, pickle.dumps(Writes(path)))}),
    "a pickle alone": lambda path: pickle.dumps(Writes(path)),
    "another folder": lambda path: archive({f"../../..{path}": "gone", f"{path}": "gone"}),
    "a gigabyte of zeros": lambda _: of_zeros(12288),
    "a shape beyond all": lambda _: archive(
        {"w.npy": array("{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999, 9999999999), }")}
    ),
    "nothing in it": lambda _: archive({}),
    "code for a header": lambda path: archive({"w.npy": array(f"open({str(path)!r}, 'w')")}),
}


@pytest.mark.parametrize("harm", HARMFUL)
def test_no_archive_runs_code_or_fills_the_memory(tmp_path, harm):
    planted = tmp_path / "planted"
    files = {"main.yaml": AROUND_A_MATRIX.replace("FILE", "m.npz").encode(), "m.npz": HARMFUL[harm](planted)}
    trial = Trial("matrix", files, "m.npz")
    assert judged_apart(trial) is None
    if "gigabyte" not in harm:
        errors, _ = check(trial.write(tmp_path / "files"))
        assert errors
    assert not planted.exists()

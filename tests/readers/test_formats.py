"""Every format gives the same recording as a CSV file; of damaged and hostile files a message with
place and remedy, nothing executed, nothing opened."""

import gc
import io
import pickle
import sys
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import asammdf
import h5py
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
import scipy.io
from asammdf.blocks.v4_blocks import ChannelConversion
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording

from rulec.cli import main
from tests.conftest import Capsys, Patch
from tests.readers.conftest import ABC
from tests.readers.writers import WRITERS, readings_of
from tests.runtime.sheets import example, write

READINGS = readings_of(example("leakage_A"))
KEPT_BY = {"openpyxl.xlsx": "1 row above the titles left out"}
"""Remarks that belong to what a file holds beside the table."""


@pytest.fixture(scope="module", autouse=True)
def _what_was_there_before_is_no_garbage() -> None:
    """With each refused file the reader looks for garbage, which takes seconds behind other tests:
    only what is made here is looked through."""
    gc.collect()
    gc.freeze()


def made(folder: Path, name: str, dated: bool = False) -> Path:
    file = folder / f"x{Path(name).suffix}"
    WRITERS[name][0](file, READINGS, dated)
    return file


def same(expected: Recording, found: Recording) -> None:
    """Every number is the same, to the last bit."""
    np.testing.assert_array_equal(found.time, expected.time)
    assert expected.values.keys() == found.values.keys()
    for name, values in expected.values.items():
        np.testing.assert_array_equal(found.values[name], values, err_msg=name)
    np.testing.assert_array_equal(found.segment, expected.segment)
    assert expected.calendar == found.calendar
    assert expected.missing == found.missing
    assert expected.scales == found.scales
    assert expected.clock == found.clock


CASES = [(name, False) for name in WRITERS] + [(name, True) for name in WRITERS if WRITERS[name][1]]


@pytest.mark.parametrize(("name", "dated"), CASES)
def test_every_format_gives_the_same(name: str, dated: bool, tmp_path: Path, abc: Ruleset) -> None:
    """The recording, so its diagnosis, is that of the CSV file, with the units of the file."""
    units = WRITERS[name][2]
    csv, file = write(tmp_path, READINGS.csv(dated, units), "x.csv"), made(tmp_path, name, dated)
    expected, found = read_recording(csv, abc), read_recording(file, abc)
    zoned = name in ("openpyxl.xlsx", "xlsxwriter.xlsx")  # Excel knows no zones
    if dated and zoned:
        bare = write(tmp_path, READINGS.csv(dated, units).replace("Z,", ","), "x.csv")
        expected = read_recording(bare, abc)
    same(expected, found)
    beside = KEPT_BY.get(name)
    notes = [note.replace(file.name, "x.csv") for note in found.notes]
    assert sorted(expected.notes) == sorted(n for n in notes if not (beside and beside in n))


@pytest.mark.parametrize("name", ["pyarrow.parquet", "openpyxl.xlsx", "asammdf4.mf4", "run#3.csv"])
def test_standard_input(
    name: str, tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It can be read again, as `simulate` does; the name of a file may hold the sign of a table."""
    text = READINGS.csv(dated=False)
    file = write(tmp_path, text, name) if "#" in name else made(tmp_path, name)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(file.read_bytes())))
    for _ in range(2):
        same(read_recording(file, abc), read_recording(Path("-"), abc))
    assert 0 == main(["diagnose", str(ABC), "-", "-q"])


@pytest.mark.parametrize("name", ["openpyxl.xlsx", "h5py.h5"])
def test_simulated_recordings_are_written_as_csv(name: str, tmp_path: Path, capsys: Capsys) -> None:
    """With titles and units of the file, and dates as it holds them; a folder file by file."""
    folder = tmp_path / "runs"
    folder.mkdir()
    file = made(folder, name, dated=True)
    assert 0 == main(["simulate", str(ABC), str(folder), "-o", str(tmp_path / "out")])
    written = (tmp_path / "out" / "x.csv").read_text(encoding="utf-8").splitlines()
    assert {"A.n [rpm]", "A.dp [bar]", "C.dp [bar]"} <= set(written[0].split(","))
    assert 81 == len(written)
    row = dict(zip(written[0].split(","), written[1].split(","), strict=True))
    time = next(value for title, value in row.items() if title.startswith("time"))
    assert time.startswith("2025-03-31T14:05:00")
    assert READINGS.columns["A.n"][1][0] == float(row["A.n [rpm]"])
    assert 2 == main(["simulate", str(ABC), str(file), "-o", str(tmp_path / "out.parquet")])
    assert "recordings are written as CSV; name it .csv" in capsys.readouterr().err
    assert not (tmp_path / "out.parquet").exists()


def read_or_refused(file: Path, ruleset: Ruleset) -> Recording | str:
    """The recording, or a message that begins with the path of the file."""
    try:
        return read_recording(file, ruleset)
    except RecordingRefused as error:
        text = str(error)
    assert text.startswith(f"{file}: ")
    return text


def refusal(file: Path, ruleset: Ruleset) -> str:
    found = read_or_refused(file, ruleset)
    assert isinstance(found, str)
    return found


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.prove) if "f3" in n else n for n in WRITERS]
)
def test_damaged_files(name: str, tmp_path: Path, abc: Ruleset) -> None:
    """A copy that was broken off says so, and what to do; of what is written while it is measured,
    what is whole is read. Flipped bytes give a recording or a message, and no traceback."""
    file, random = made(tmp_path, name), np.random.default_rng(7)
    data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
    for share in (0.02, 0.5, 0.98):
        file.write_bytes(data[: int(share * len(data))].tobytes())
        found = read_or_refused(file, abc)
        if name.endswith((".tdms", ".mf4", ".mdf")):
            assert isinstance(found, str) or 0 < len(found) <= len(READINGS.seconds)
        else:
            assert isinstance(found, str)
            assert "export it anew" in found or "no column" in found, found
    for _ in range(3):
        flipped = data.copy()
        flipped[random.integers(64, len(data), 12)] = random.integers(0, 256, 12)
        file.write_bytes(flipped.tobytes())
        read_or_refused(file, abc)


def test_what_may_run_or_has_no_titles(tmp_path: Path, abc: Ruleset) -> None:
    """Pickles are never loaded; a package of files is none. A name alone makes no format; a Parquet
    file called .csv is read as what it is."""
    array, packed = io.BytesIO(), io.BytesIO()
    np.save(array, np.zeros(3))
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("recording.csv", example().text())
    for expected, raw in {
        "a pickle": pickle.dumps(_Trap(tmp_path)),
        "an array of NumPy": array.getvalue(),
        "no Excel workbook": packed.getvalue(),
    }.items():
        assert expected in refusal(write(tmp_path, raw, "x.dat"), abc)
    assert not (tmp_path / "trapped").exists()
    for name in ("x.parquet", "x.xlsx", "x.mat", "x.mf4", "x.tdms", "x.h5"):
        text = refusal(write(tmp_path, example().text(), name), abc)
        assert "though it is called so" in text
    file = made(tmp_path, "pyarrow.parquet").rename(tmp_path / "x.csv")
    assert 80 == len(read_recording(file, abc))


class _Trap:
    """Leaves a folder where it is loaded."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __reduce__(self) -> Any:
        return Path.mkdir, (self._folder / "trapped",)


def test_hostile_workbooks(tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of zeros packs to a thousandth of its size; entities lead elsewhere; a sheet with one
    cell in its last corner is read as far as it has rows."""
    monkeypatch.setattr(limits, "FREE_TO_UNPACK", 1_000_000)
    entity = b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    for part, data, expected in (
        ("xl/media/image9.bin", bytes(40_000_000), "unpacks to more than 100 times its size"),
        ("xl/extra.xml", entity, "xl/extra.xml in it declares a document type"),
    ):
        file = made(tmp_path, "openpyxl.xlsx")
        with zipfile.ZipFile(file, "a", zipfile.ZIP_DEFLATED) as packed:
            packed.writestr(part, data)
        assert expected in refusal(file, abc)
    book = openpyxl.Workbook()
    for row in (example().header, *(map(float, row) for row in example().rows)):
        book.active.append([*row])
    book.active["XFD9000"] = "x"
    book.save(tmp_path / "x.xlsx")
    assert 60 == len(read_recording(tmp_path / "x.xlsx", abc))


@pytest.mark.parametrize("name", ["scipy.mat", "pyarrow.parquet", "h5py.h5"])
def test_columns_that_unpack_to_too_much(
    name: str, tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows of one number pack to nearly nothing, whatever packs them."""
    monkeypatch.setattr(limits, "FREE_TO_UNPACK", 100_000)
    monkeypatch.setattr(limits, "DENSEST", 20)
    rows = 400_000
    columns = {"time": np.zeros(rows), "A.dp": np.zeros(rows)}
    file = tmp_path / f"x{Path(name).suffix}"
    if name.endswith(".mat"):
        scipy.io.savemat(file, {"x": columns}, do_compression=True)
    elif name.endswith(".parquet"):
        pa.parquet.write_table(pa.table(columns), file, compression="zstd")
    else:
        with h5py.File(file, "w") as made_file:
            for title, values in columns.items():
                made_file.create_dataset(title, data=values, compression="gzip")
    assert "unpacks to more than" in refusal(file, abc)


def outside_link(file: h5py.File, other: Path) -> None:
    file["A.dp"] = h5py.ExternalLink(str(other), "time")


def outside_storage(file: h5py.File, other: Path) -> None:
    file.create_dataset("A.dp", (60,), "f8", external=[(str(other), 0, h5py.h5f.UNLIMITED)])


def outside_view(file: h5py.File, other: Path) -> None:
    layout = h5py.VirtualLayout((60,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "time", (60,))
    file.create_virtual_dataset("A.dp", layout)


@pytest.mark.parametrize("lead", [outside_link, outside_storage, outside_view])
def test_hdf5_never_leads_out_of_its_file(
    lead: Callable[[h5py.File, Path], None], tmp_path: Path, abc: Ruleset
) -> None:
    """Links, storage and views elsewhere are not followed, and that is told."""
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["time"] = np.arange(60.0)
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["time"] = np.arange(60.0)
        file["B.dp"] = np.arange(60.0)
        lead(file, other)
    found = read_recording(tmp_path / "x.h5", abc)
    assert "A.dp" not in found.values
    assert "x.h5: 'A.dp' leads out of the file and is not followed" in found.notes
    with h5py.File(tmp_path / "y.h5", "w") as file:
        lead(file, other)
    assert "copy what it leads to into the file" in refusal(tmp_path / "y.h5", abc)


def test_structures_without_end(tmp_path: Path, abc: Ruleset, monkeypatch: Patch) -> None:
    """A group that stands in itself is looked at once, many groups are refused; of structures in
    structures some levels are looked at, and no more."""
    monkeypatch.setattr(limits, "MOST_OBJECTS", 50)
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["time"] = file["A.dp"] = np.arange(60.0)
        file["again"] = file["/"]
    assert 60 == len(read_recording(tmp_path / "x.h5", abc))
    with h5py.File(tmp_path / "y.h5", "w") as file:
        for k in range(60):
            file.create_group(str(k))
    assert "more than 50 arrays and groups" in refusal(tmp_path / "y.h5", abc)
    inner: dict[str, Any] = {"x": 1.0}
    for _ in range(30):
        inner = {"s": inner}
    scipy.io.savemat(tmp_path / "x.mat", inner)
    assert "holds no columns of numbers" in refusal(tmp_path / "x.mat", abc)


def test_matlab_objects_are_not_read(tmp_path: Path, abc: Ruleset) -> None:
    """A timetable is an object that MATLAB alone can read: what to write there instead."""
    table = np.zeros((1, 1), dtype=[("Time", object)])
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"run": scipy.io.matlab.MatlabObject(table, "timetable")})
    text = refusal(write(tmp_path, buffer.getvalue(), "x.mat"), abc)
    assert "'run' is an object of MATLAB" in text
    assert "table2struct(timetable2table(T), 'ToScalar', true)" in text


def test_formulas_in_mdf_are_not_evaluated(tmp_path: Path, abc: Ruleset) -> None:
    """A channel that a formula in the file is to calculate has no reading."""
    time = np.arange(60.0)
    file = asammdf.MDF(version="4.10")
    file.header.start_time = datetime(1970, 1, 1, tzinfo=UTC)
    conversion = ChannelConversion(conversion_type=3, formula="__import__('os').getpid()+X1")
    file.append([
        asammdf.Signal(time, time, unit="bar", name=name, conversion=own)
        for name, own in (("A.dp", conversion), ("B.dp", None))
    ])  # fmt: skip
    file.save(tmp_path / "x.mf4")
    found = read_recording(tmp_path / "x.mf4", abc)
    assert "A.dp" not in found.values
    assert any("'A.dp' is to be calculated by a formula" in note for note in found.notes)


def test_groups_of_several_rates(tmp_path: Path, abc: Ruleset) -> None:
    """MDF and TDMS keep a clock per group: the one that is meant is named."""
    file = asammdf.MDF(version="4.10")
    for step in (1.0, 10.0):
        time = np.arange(0.0, 60.0, step)
        file.append([asammdf.Signal(time, time, unit="bar", name="A.dp")])
    file.save(tmp_path / "x.mf4")
    assert "'x.mf4#group 0': 'group 0' (60 rows of" in refusal(tmp_path / "x.mf4", abc)
    assert 6 == len(read_recording(tmp_path / "x.mf4#group 1", abc))
    with nptdms.TdmsWriter(tmp_path / "x.tdms") as writer:
        writer.write_segment([
            nptdms.ChannelObject("run", name, np.arange(60.0 / step), {"wf_increment": step})
            for name, step in (("A.dp", 1.0), ("B.dp", 10.0))
        ])  # fmt: skip
    assert "'run/60 rows at 1 s'" in refusal(tmp_path / "x.tdms", abc)
    assert 6 == len(read_recording(tmp_path / "x.tdms#run/6 rows at 10 s", abc))


EXTRAS = {"pyarrow.parquet": "parquet", "openpyxl.xlsx": "excel", "scipy.mat": "mat",
          "asammdf4.mf4": "mdf", "nptdms.tdms": "tdms", "h5py.h5": "hdf5"}  # fmt: skip


@pytest.mark.parametrize(("name", "extra"), [*EXTRAS.items()])
def test_missing_package_names_its_extra(
    name: str, extra: str, tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An operator station has what it asked for; the message says what to install."""
    file = made(tmp_path, name)

    def lacking(module: str) -> Any:
        raise ModuleNotFoundError(f"No module named '{module}'", name="pyarrow")

    monkeypatch.setattr("rulec_runtime.recordings.formats.import_module", lacking)
    assert f"pip install 'rulec-runtime[{extra}]'" in refusal(file, abc)

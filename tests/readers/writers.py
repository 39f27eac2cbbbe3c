"""The same recording, written by the programs that write such files."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import asammdf
import h5py
import hdf5storage
import nptdms
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import scipy.io
import xlsxwriter

from tests.runtime.sheets import Sheet

START = datetime(2025, 3, 31, 14, 5, tzinfo=UTC)


@dataclass(frozen=True)
class Readings:
    """Numbers of a recording: per signal its unit and values, shape (n,); `seconds` its times."""

    seconds: np.ndarray
    columns: Mapping[str, tuple[str, np.ndarray]]

    @property
    def dates(self) -> np.ndarray:
        """Times from `START` on, to the microsecond."""
        start = np.datetime64(START.replace(tzinfo=None)).astype("M8[us]")
        return start + np.round(self.seconds * 1e6).astype("m8[us]")

    def titled(self) -> Iterator[tuple[str, np.ndarray]]:
        return ((f"{name} [{unit}]", values) for name, (unit, values) in self.columns.items())

    def csv(self, dated: bool, units: bool = True) -> str:
        times = [f"{d}Z" for d in self.dates.astype(str)] if dated else self.seconds.tolist()
        names = [title if units else title.partition(" ")[0] for title, _ in self.titled()]
        rows = zip(times, *(v.tolist() for _, v in self.columns.values()), strict=True)
        return "\n".join(",".join(map(str, row)) for row in [("time", *names), *rows]) + "\n"


def readings_of(sheet: Sheet) -> Readings:
    table = np.array(sheet.rows, dtype=float)
    names = [title.partition(" [") for title in sheet.header]
    columns = {name: (unit.strip("]"), table[:, i]) for i, (name, _, unit) in enumerate(names) if i}
    return Readings(table[:, 0], columns)


def arrow(readings: Readings, dated: bool) -> pa.Table:
    """A table whose fields hold units in their metadata."""
    times = pa.array(readings.dates, pa.timestamp("us", "UTC")) if dated else readings.seconds
    fields = [pa.field("time", pa.timestamp("us", "UTC") if dated else pa.float64())]
    fields += [
        pa.field(name, pa.float64(), metadata={"unit": unit})
        for name, (unit, _) in readings.columns.items()
    ]
    return pa.table([times, *(v for _, v in readings.columns.values())], schema=pa.schema(fields))


def parquet(path: Path, readings: Readings, dated: bool) -> None:
    pa.parquet.write_table(arrow(readings, dated), path, row_group_size=17)


def feather(path: Path, readings: Readings, dated: bool) -> None:
    pa.feather.write_feather(arrow(readings, dated), str(path), chunksize=17)


def frame(readings: Readings, dated: bool) -> pd.DataFrame:
    """A data frame whose index is the time, without a name where it holds dates."""
    index = pd.DatetimeIndex(readings.dates, tz="UTC") if dated else readings.seconds
    found = pd.DataFrame(dict(readings.titled()), index=index)
    return found if dated else found.rename_axis("time")


def pandas_parquet(path: Path, readings: Readings, dated: bool) -> None:
    frame(readings, dated).to_parquet(path)


def excel(path: Path, readings: Readings, dated: bool) -> None:
    """Titles with a row of units below them, as openpyxl writes a workbook; a sheet of prose."""
    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active.append(["Recorded at the rig", "by night shift"])
    page = book.create_sheet("Readings")
    page.append(["Test rig 3"])
    page.append(["time", *readings.columns])
    page.append(["s", *(unit for unit, _ in readings.columns.values())])
    for row in _rows(readings, dated):
        page.append(row)
    book.save(path)


def xlsx(path: Path, readings: Readings, dated: bool) -> None:
    """Titles with units, as XlsxWriter writes a workbook."""
    book = xlsxwriter.Workbook(path, {"default_date_format": "yyyy-mm-dd hh:mm:ss.000"})
    page = book.add_worksheet()
    page.write_row(0, 0, ["time", *(title for title, _ in readings.titled())])
    for k, row in enumerate(_rows(readings, dated)):
        page.write_row(k + 1, 0, row)
    book.close()


def _rows(readings: Readings, dated: bool) -> list[list[Any]]:
    times = readings.dates.tolist() if dated else readings.seconds.tolist()
    return [
        list(row)
        for row in zip(times, *(v.tolist() for _, v in readings.columns.values()), strict=True)
    ]


def structured(readings: Readings) -> dict[str, Any]:
    """Time, and a structure per module with its signals, as names of MATLAB allow it."""
    found: dict[str, Any] = {"time": readings.seconds}
    for name, (_, values) in readings.columns.items():
        module, _, signal = name.partition(".")
        found.setdefault(module, {})[signal] = values
    return found


def mat5(path: Path, readings: Readings, _: bool) -> None:
    scipy.io.savemat(path, {"run": structured(readings)}, do_compression=True)


def mat73(path: Path, readings: Readings, _: bool) -> None:
    hdf5storage.savemat(str(path), structured(readings), format="7.3")


def mdf4(path: Path, readings: Readings, dated: bool) -> None:
    _mdf(path, readings, dated, "4.10")


def mdf3(path: Path, readings: Readings, dated: bool) -> None:
    _mdf(path, readings, dated, "3.30")


def _mdf(path: Path, readings: Readings, dated: bool, version: str) -> None:
    file = asammdf.MDF(version=version)
    file.header.start_time = START if dated else datetime(1970, 1, 1, tzinfo=UTC)
    signals = [
        asammdf.Signal(values, readings.seconds, unit=unit, name=name)
        for name, (unit, values) in readings.columns.items()
    ]
    file.append(signals)
    file.save(path, overwrite=True)


def tdms(path: Path, readings: Readings, dated: bool) -> None:
    """Waveforms where the recording has dates, else a channel of seconds."""
    step = float(readings.seconds[1] - readings.seconds[0])
    clock = {"wf_increment": step, "wf_start_offset": float(readings.seconds[0])}
    clock |= {"wf_start_time": START.replace(tzinfo=None)}
    channels = [
        nptdms.ChannelObject("run", name, values, {"unit_string": unit, **(clock if dated else {})})
        for name, (unit, values) in readings.columns.items()
    ]
    if not dated:
        channels.insert(0, nptdms.ChannelObject("run", "time", readings.seconds))
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def hdf5(path: Path, readings: Readings, dated: bool) -> None:
    """A group of arrays; dates as text."""
    with h5py.File(path, "w") as file:
        group = file.create_group("run 1")
        group["time"] = [f"{d}Z" for d in readings.dates] if dated else readings.seconds
        for name, (unit, values) in readings.columns.items():
            group.create_dataset(name, data=values, compression="gzip").attrs["units"] = unit


def records(path: Path, readings: Readings, _: bool) -> None:
    """An array of records, a column a field."""
    names = ["time", *(title for title, _ in readings.titled())]
    values = [readings.seconds, *(v for _, v in readings.columns.values())]
    with h5py.File(path, "w") as file:
        file["table"] = np.rec.fromarrays(values, names=names)


WRITERS: dict[str, tuple[Callable[[Path, Readings, bool], None], bool, bool]] = {
    "pyarrow.parquet": (parquet, True, True),
    "pandas.parquet": (pandas_parquet, True, True),
    "pyarrow.feather": (feather, True, True),
    "openpyxl.xlsx": (excel, True, True),
    "xlsxwriter.xlsx": (xlsx, True, True),
    "scipy.mat": (mat5, False, False),
    "hdf5storage.mat": (mat73, False, False),
    "asammdf4.mf4": (mdf4, True, True),
    "asammdf3.mdf": (mdf3, True, True),
    "nptdms.tdms": (tdms, True, True),
    "h5py.h5": (hdf5, True, True),
    "h5py_records.hdf5": (records, False, True),
}
"""By name of the file: its writer, whether it can hold dates, and units."""

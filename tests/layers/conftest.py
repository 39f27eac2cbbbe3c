"""A plant with knowledge of its own, and a package with more, as a maker would ship it."""

import importlib
from collections.abc import Callable
from pathlib import Path

import pytest

VALVE = """\
module: acme-valve
version: 3
title: Control valve with a flow meter
signals:
  dp:
    {quantity: pressure difference, unit: inWC, sensor: piezoresistive, range: [0, 400]}
  Q:  {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, reference: 2}
parameters:
  Kv: {value: 0.5, unit: m3/h/kPa**0.5, u: 0.01, source: data sheet}
observers:
  valve: {component: valve, Q: Kv*sqrt(dp), accuracy: "10 %, IEC 60534-2-4", source: IEC 60534-2-1}
  flow:  {component: line, Q: Q, reference: true, source: flow meter}
faults: [slope(Q)]
"""
UNITS = """\
units:
  inWC: {factor: 249.08891, dimension: {kg: 1, m: -1, s: -2}, note: inch of water}
"""
PLANT = """\
plant: p
title: one valve
modules:
  A: {type: acme-valve}
"""


def write(folder: Path, **files: str) -> Path:
    """Write files into a folder: `a__b` is `a/b.yaml`; returns the folder."""
    for name, text in files.items():
        file = folder / f"{name.replace('__', '/')}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plant of a type that nobody has described yet, in the working folder."""
    monkeypatch.delenv("RULEC_KB", raising=False)
    monkeypatch.chdir(tmp_path)
    return write(Path("p"), plant=PLANT)


Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a package beside the installed ones, as pip would; its code must not be run."""
    site = tmp_path / "site-packages"

    def installed(name: str = "acme-pumps-kb", entry: str = "acme_pumps_kb", **files: str) -> Path:
        package = write(site / name.replace("-", "_"), **files)
        (package / "__init__.py").write_text("raise RuntimeError('imported')", encoding="utf-8")
        info = site / f"{package.name}-1.2.dist-info"
        info.mkdir()
        info.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        info.joinpath("entry_points.txt").write_text(f"[rulec.kb]\nkb = {entry}\n")
        monkeypatch.syspath_prepend(str(site))
        importlib.invalidate_caches()
        return package

    return installed

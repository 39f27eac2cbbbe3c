"""Modules apart, central part apart: are the findings those of the whole?"""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.limits import IMPROBABLE
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import read_recording

from rulec.export.c_printer import header, source
from rulec.export.module_code import code_of
from rulec.export.play_on_recording import Execute, played, results_csv
from rulec.export.program import ModuleCode, Routine, Value, Variable, run
from rulec.export.value_names import listed_undo
from tests.conftest import ROOT, recordings_folder
from tests.rig import esp, zema
from tests.rig.called import called


@dataclass(frozen=True)
class Split:
    """One recording judged as a whole and by way of its modules: with mean readings beside their
    results, and by slopes alone."""

    whole: Diagnosis
    given: Diagnosis
    first_order: Diagnosis


def split(ruleset: Ruleset, recording: Path, work: Path) -> Split:
    """Judge a recording in all ways; modules are compiled C where there is a compiler."""
    # Modules know listed faults alone.
    ruleset = replace(ruleset, unlisted=(), unlisted_cells=(), undo=listed_undo(ruleset))
    read = read_recording(recording, ruleset)
    codes = code_of(ruleset)
    execute: Execute = run if COMPILER is None else compiled(codes, work).run
    columns = played(read, ruleset, codes, execute)
    (work / "results.csv").write_text(results_csv(columns), encoding="utf-8")
    bare = {n: c for n, c in columns.items() if n.partition(" [")[0] not in ruleset.signal_by_id}
    (work / "bare.csv").write_text(results_csv(bare), encoding="utf-8")
    results = read_results(work / "results.csv", ruleset)
    return Split(
        diagnose(read, ruleset),
        diagnose_results(results, ruleset),
        diagnose_results(read_results(work / "bare.csv", ruleset), ruleset),
    )


def same_story(a: Diagnosis, b: Diagnosis) -> bool:
    """The same faults at the same times with the same rivals; the same that nothing explains,
    and the same regimes."""
    return _story(a) == _story(b)


def _story(diagnosis: Diagnosis) -> tuple[object, ...]:
    found = [
        (*_key(f), round(f.until, 6), sorted(name for name, _ in f.alternatives))
        for f in sorted(diagnosis.findings, key=_key)
    ]
    unknown = [(round(p.since, 6), round(p.until, 6), p.text) for p in diagnosis.unknown]
    regimes = [(r.regime.id, round(r.since, 6), round(r.until, 6)) for r in diagnosis.regimes]
    return found, unknown, regimes


def gaps(a: Diagnosis, b: Diagnosis) -> Iterator[float]:
    """By how much degrees, their bounds and residuals of findings differ, as shares of what they
    are where they are above 1; one finding after the other. Probabilities differ only by faults
    that are too improbable to be tried, which rounding may decide."""
    pairs = zip(sorted(a.findings, key=_key), sorted(b.findings, key=_key), strict=False)
    for one, other in pairs:
        assert abs(one.probability - other.probability) < IMPROBABLE
        yield from (
            abs(x - y) / max(abs(x), 1.0) for x, y in zip(*map(_values, (one, other)), strict=True)
        )


def _values(f: Finding) -> tuple[float, ...]:
    residuals = (e.value / e.threshold for e in f.evidence if e.threshold)
    return (f.degree, f.lower, f.upper, *residuals)


def _key(finding: Finding) -> tuple[str, float]:
    return finding.fault.id, round(finding.since, 6)


COMPILER = shutil.which("gcc")
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
FLAGS = [*WARNINGS, "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
TYPES = {"real": np.float64, "bool": np.bool_}


@dataclass(frozen=True)
class Compiled:
    """All modules of a plant as one library."""

    library: ctypes.CDLL
    modules: Mapping[int, str]

    def run(self, routine: Routine, values: Mapping[str, Value]) -> dict[str, Value]:
        """Outputs of a routine at n points, as `rulec.export.program.run` gives them."""
        shape = np.broadcast_shapes(*(np.shape(values[v.name]) for v in routine.inputs))
        given = np.zeros(shape or (1,), dtype=_layout(routine.inputs))
        for v in routine.inputs:
            given[v.name] = values[v.name]
        found = np.zeros(given.shape, dtype=_layout(routine.outputs))
        call = self.library[f"every_{self.modules[id(routine)]}_{routine.name}"]
        call(given.ctypes, found.ctypes, ctypes.c_long(len(given)))
        return {v.name: found[v.name] for v in routine.outputs}


def compiled(codes: Iterable[ModuleCode], folder: Path) -> Compiled:
    """Write, compile and load; a warning is an error."""
    codes = tuple(codes)
    drivers = ["#include <stddef.h>"]
    for code in codes:
        (folder / f"{code.name}.h").write_text(header(code), encoding="ascii")
        (folder / f"{code.name}.c").write_text(source(code), encoding="ascii")
        drivers.append(f'#include "{code.name}.h"')
        drivers += [_driver(f"{code.name}_{routine.name}") for routine in code.routines]
    (folder / "every.c").write_text("\n".join(drivers) + "\n", encoding="ascii")
    files = sorted(str(file) for file in folder.glob("*.c"))
    library = folder / "observers.so"
    assert COMPILER is not None
    subprocess.run([COMPILER, *FLAGS, *files, "-o", str(library), "-lm"], check=True)
    modules = {id(routine): code.name for code in codes for routine in code.routines}
    return Compiled(ctypes.CDLL(str(library)), modules)


def _driver(name: str) -> str:
    """A function that calls one of ours for many points."""
    head = f"void every_{name}(const struct {name}_in *in, struct {name}_out *out, long n)"
    prototype = f"{head};"
    return f"{prototype}\n{head} {{ for (long i = 0; i < n; i++) {name}(in + i, out + i); }}"


def _layout(variables: Iterable[Variable]) -> np.dtype:
    return np.dtype([(v.name, TYPES[v.kind]) for v in variables], align=True)


HSY = "hsy-wastewater-pumping/hsy_15min.csv"
ZEMA = "zema-hydraulic"
CYCLES = range(300, 500)
"""Of the ZeMA rig: with leakages of all sizes."""


def shipped() -> Iterator[tuple[Path, Path]]:
    """Plants with their examples."""
    for plant in ("abc", "mixing-rig"):
        folder = ROOT / "plants" / plant
        for file in sorted((folder / "examples").glob("*.csv")):
            if len(file.suffixes) == 1:  # neither inputs nor a truth
                yield folder, file


def real(work: Path) -> Iterator[tuple[Path, Path]]:
    """Plants with real recordings, as far as these are there; a folder takes what is cut out."""
    plants, shared = ROOT / "plants", recordings_folder()
    if (shared / HSY).exists():
        yield plants / "hsy-pumping", shared / HSY
    if (shared / esp.FOLDER).is_dir():
        for impeller in esp.IMPELLERS:
            for chosen in (esp.of_water, esp.of_glycerin):
                file = work / f"{impeller} {chosen.__name__}.csv"
                esp.write_points(shared / esp.FOLDER, impeller, chosen, file)
                yield plants / "esp-pump" / f"{impeller.lower()}.yaml", file
    if (shared / ZEMA).is_dir():
        file = work / "zema.csv"
        zema.write_cycles(shared / ZEMA, set(CYCLES), file)
        for name in zema.PLANTS.values():
            yield plants / "zema-hydraulic" / name, file


DEGREES = (0.1, 0.6)
PLANT = ROOT / "plants" / "abc"
INPUTS = PLANT / "examples" / "healthy.csv"
SINCE = 30.0
SEED = 7


@dataclass(frozen=True)
class Judged:
    """A simulated fault: is it the one that is named, and by how much is its degree off?"""

    degree: float
    right: bool
    error: float


def judged(ruleset: Ruleset, work: Path) -> Iterator[tuple[Judged, Judged]]:
    """Every fault at every degree: by the whole, and to first order."""
    for fault in ruleset.faults:
        for degree in DEGREES:
            folder = work / re.sub(r"\W", "_", f"{fault.id} {degree}")
            folder.mkdir()
            file = folder / "recording.csv"
            acts = f"{fault.id}={degree}@{SINCE:g}:1000"
            called("simulate", PLANT, INPUTS, "-o", file, "--fault", acts, "--noise", SEED)
            found = split(ruleset, file, folder)
            yield (
                _verdict(found.whole, fault.id, degree),
                _verdict(found.first_order, fault.id, degree),
            )


def _verdict(diagnosis: Diagnosis, fault: str, degree: float) -> Judged:
    if not diagnosis.findings:
        return Judged(degree, False, degree)
    last = max(diagnosis.findings, key=lambda f: f.until)
    return Judged(degree, last.fault.id == fault, abs(last.degree - degree))

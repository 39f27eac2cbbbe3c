"""Run exported C: compiled with every warning an error, called for many points at once."""

import ctypes
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rulec.export.c_printer import header, source
from rulec.export.program import ModuleCode, Routine, Value, Variable

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

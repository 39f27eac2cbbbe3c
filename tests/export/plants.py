"""Compiled plants with their code, once for all tests."""

import functools
import tempfile
from pathlib import Path

from rulec.export.module_code import code_of
from rulec.export.program import ModuleCode
from tests.conftest import compiled
from tests.rig.exported.split import COMPILER, Compiled
from tests.rig.exported.split import compiled as compile_c

NO_COMPILER = "no gcc on this machine"


@functools.cache
def codes(plant: str) -> tuple[ModuleCode, ...]:
    """Code of all modules of a shipped plant."""
    return code_of(compiled(plant))


@functools.cache
def library(plant: str, modules: tuple[str, ...]) -> Compiled:
    """Some of them as a library; its files are gone once it is loaded."""
    assert COMPILER is not None, NO_COMPILER
    chosen = [code for code in codes(plant) if code.module in modules]
    with tempfile.TemporaryDirectory() as folder:
        return compile_c(chosen, Path(folder))

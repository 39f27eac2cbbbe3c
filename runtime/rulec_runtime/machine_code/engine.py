"""numba's LLVM: turns code into machine code and runs it in this process."""

from __future__ import annotations

import importlib.util
import itertools
import threading
from collections.abc import Sequence
from functools import cache
from typing import Any

from rulec_runtime import limits

_NUMBERS = itertools.count()
ONE_AT_A_TIME = threading.RLock()
"""Held while something is made: all threads share LLVM's engine."""


@cache
def there_is_llvm() -> bool:
    """Whether machine code can be made here: it comes with numba, an extra."""
    return importlib.util.find_spec("numba") is not None


def made(name: str, code: str) -> int:
    """The address of a function, made for this machine; it lives as long as the process.

    The source is released: a function takes 30 kB, with its source 0.8 MB.
    """
    import llvmlite.binding as llvm

    with ONE_AT_A_TIME:
        module = llvm.parse_assembly(code)
        own = f"{name}_{next(_NUMBERS)}"
        module.get_function(name).name = own
        engine = _engine()
        engine.add_module(module)
        engine.finalize_object()
        address = int(engine.get_function_address(own))
        engine.remove_module(module)
        module.close()
    return address


def object_of(code: str) -> bytes:
    """Machine code as bytes, which another start on such a machine may load.

    LLVM optimises more here than for `made`: kept code is paid for once.
    """
    import llvmlite.binding as llvm

    with ONE_AT_A_TIME, llvm.parse_assembly(code) as module:
        return bytes(_machine(limits.KEPT_CODE_EFFORT).emit_object(module))


def loaded(data: bytes, names: Sequence[str]) -> tuple[int, ...]:
    """Addresses of functions in the result of `object_of`; their names must be new to this process.

    Raises RuntimeError or OSError if it is no machine code, or lacks these functions.
    """
    import llvmlite.binding as llvm

    with ONE_AT_A_TIME:
        engine = _engine()
        engine.add_object_file(llvm.ObjectFileRef.from_data(data))
        engine.finalize_object()
        found = tuple(int(engine.get_function_address(name)) for name in names)
    if not all(found):
        raise RuntimeError("functions are missing")
    return found


@cache
def made_for() -> str:
    """What machine code depends on besides its source: versions, and the kind of this machine."""
    import llvmlite
    import llvmlite.binding as llvm

    kind = llvm.get_default_triple(), llvm.get_host_cpu_name(), _features()
    return repr((llvmlite.__version__, llvm.llvm_version_info, *kind))


def _features() -> str:
    import llvmlite.binding as llvm

    return str(llvm.get_host_cpu_features().flatten())


@cache
def _engine() -> Any:
    """An engine for this machine.

    LLVM optimises little: more would take longer than it saves.
    """
    import llvmlite.binding as llvm

    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine(0))


def _machine(effort: int) -> Any:
    """A description of this machine; an engine keeps its own."""
    import llvmlite.binding as llvm

    _begun()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=effort, jit=True
    )


@cache
def _begun() -> None:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()

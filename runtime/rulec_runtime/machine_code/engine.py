"""numba's LLVM: turns code into machine code and runs it in this process."""

from __future__ import annotations

import importlib.util
import itertools
import threading
from functools import cache
from typing import Any

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
        engine = _engine()
        module = llvm.parse_assembly(code)
        own = f"{name}_{next(_NUMBERS)}"
        module.get_function(name).name = own
        engine.add_module(module)
        engine.finalize_object()
        address = int(engine.get_function_address(own))
        engine.remove_module(module)
        module.close()
    return address


@cache
def _engine() -> Any:
    """An engine for this machine.

    LLVM optimises little: more would take longer than it saves.
    """
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=0, jit=True
    )
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)

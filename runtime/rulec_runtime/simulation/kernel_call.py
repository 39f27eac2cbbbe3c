"""Calls of a kernel's functions from code that numba compiled; needs numba."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rulec_runtime.simulation.llvm_code import LANES

__all__ = ["LANES", "advance", "evaluate"]


def _call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Call the function at the first argument; arrays are passed as pointers."""
    given = [
        context.make_array(kind)(context, builder, argument).data
        if isinstance(kind, types.Array)
        else argument
        for kind, argument in zip(signature.args[1:], arguments[1:], strict=True)
    ]
    kind = ir.FunctionType(ir.VoidType(), [value.type for value in given])
    builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), given)
    return context.get_dummy_value()


def _evaluate(_: Any, address: Any, values: Any, slopes: Any) -> Any:
    return types.void(address, values, slopes), _call


def _advance(
    _: Any, address: Any, values: Any, slopes: Any, x: Any, dx: Any, k: Any, given: Any, step: Any
) -> Any:
    return types.void(address, values, slopes, x, dx, k, given, step), _call


evaluate: Any = intrinsic(_evaluate)
advance: Any = intrinsic(_advance)

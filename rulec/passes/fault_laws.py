"""Laws of faults as changes of a module type have them: over ``law`` and the degree ``x``."""

from __future__ import annotations

import functools

import sympy

from rulec.knowledge.knowledge import Variant
from rulec.language.expression import Expression, parse
from rulec.language.invert import invert
from rulec.passes.differentiate import law_of


@functools.lru_cache(maxsize=100)
def undoing(variant: Variant, acts_on: str) -> Expression:
    """What should be there, over ``law`` (what is there) and the degree ``x``.

    A flow fault takes away behind the observer, whose flow is what should be there.
    """
    if acts_on == "flow":
        return doing(variant)
    g, x, law = (sympy.Symbol(name, real=True) for name in ("g", "x", "law"))
    solved = invert(law_of(variant, g, x), g, law)
    assert solved is not None, "checked when the fault was read"
    return parse(sympy.sstr(solved))


@functools.lru_cache(maxsize=100)
def doing(variant: Variant) -> Expression:
    """What is there, over ``law`` (what should be there) and the degree ``x``."""
    x, law = (sympy.Symbol(name, real=True) for name in ("x", "law"))
    return parse(sympy.sstr(law_of(variant, law, x)))

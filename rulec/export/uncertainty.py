"""Standard uncertainties: of readings, and of signed sums of estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import rulec_runtime.limits as runtime_limits
from rulec_runtime.contract.ruleset import SignalSpec

from rulec.export.identifiers import Outputs
from rulec.export.program import Apply, Expression, Name, Number, Statement, Variable, apply, total
from rulec.export.readings import Reading, noise_in_si

Terms = list[tuple[int, Name]]
"""A signed sum."""


def of_reading(
    reading: Reading, noise: Variable, whole: str, outputs: Outputs
) -> Iterator[Statement]:
    """Whether a reading may be used, its uncertainties, and whether it leaves the calibrated range.

    `whole` is the name of its standard uncertainty, SI.
    """
    signal, short = reading.signal, reading.value.name
    fit = outputs.flag(f"{short}_fit", f"fit:{signal.id}", f"{short} may be used")
    yield Statement(fit, reading.ok, "bool")
    text = f"standard uncertainty of {short} that does not average out"
    systematic = outputs.number(f"{short}_systematic", f"systematic:{signal.id}", text, "SI")
    yield Statement(systematic, _systematic(signal, reading.si))
    noise_si = outputs.names.new(f"{short}_noise_SI")
    yield Statement(noise_si, noise_in_si(signal, Name(noise.name)))
    squares: list[Expression] = [apply("mul", Name(x), Name(x)) for x in (systematic, noise_si)]
    yield Statement(whole, apply("sqrt", total(squares)))
    if signal.valid_from is not None and signal.valid_to is not None:
        slack = runtime_limits.BEYOND_CALIBRATED * (signal.valid_to - signal.valid_from)
        above = apply("ge", reading.si, Number(signal.valid_from - slack))
        below = apply("le", reading.si, Number(signal.valid_to + slack))
        text = f"{short} is out of the range in which the equations were calibrated"
        beyond = outputs.flag(f"{short}_beyond", f"beyond:{signal.id}", text)
        yield Statement(beyond, apply("not", apply("and", above, below)), "bool")


def _systematic(signal: SignalSpec, value: Expression) -> Expression:
    """Systematic standard uncertainty by the sensor's class, SI."""
    if signal.kind == "reading":
        size = apply("sub", value, Number(signal.offset)) if signal.offset else value
        return apply("mul", Number(signal.standard), apply("abs", size))
    scale = (signal.full_scale or 0.0) if signal.kind == "full scale" else 1.0
    return Number(signal.standard * scale)


def spread(
    parts: Mapping[str, Terms],
    u: Mapping[str, Name],
    short: Mapping[str, str],
    into: str,
    outputs: Outputs,
) -> tuple[list[Statement], Expression]:
    """The statements that a standard uncertainty of a signed sum of estimates needs, and itself.

    `parts` are slopes per error, `u` the standard uncertainties of errors that are not whitened,
    `short` the names of errors.
    """
    statements: list[Statement] = []
    squares: list[Expression] = []
    for error, terms in parts.items():
        slope = signed(terms)
        if error in u:
            slope = apply("mul", slope, u[error])
        if isinstance(slope, Apply):
            name = outputs.names.new(f"{into}_due_to_{short[error]}")
            statements.append(Statement(name, slope))
            slope = Name(name)
        squares.append(apply("mul", slope, slope))
    return statements, apply("sqrt", total(squares))


def signed(terms: Terms) -> Expression:
    """A signed sum, positive terms first."""
    (sign, first), *rest = sorted(terms, key=lambda t: -t[0])
    result: Expression = first if sign > 0 else apply("neg", first)
    for sign, name in rest:
        result = apply("add" if sign > 0 else "sub", result, name)
    return result

"""Run exported structured text: parsed by the grammar of blark, its tree evaluated."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from blark import transform as st
from blark.parse import parse_source_code
from rulec_runtime import limits
from rulec_runtime.contract.plan import OPERATIONS
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady.points import outside_range
from rulec_runtime.recordings.stationary import systematic_u

from rulec.export.program import LOGIC, Routine, Value, Variable

OPERATORS = {"+": "add", "-": "sub", "*": "mul", "/": "div", ">=": "ge", ">": "gt", "<=": "le"}
OPERATORS |= {"AND": "and"}
FUNCTIONS = {"SQRT": "sqrt", "EXP": "exp", "LN": "log", "ABS": "abs", "EXPT": "pow"}
FUNCTIONS |= {"MIN": "min", "MAX": "max"}


class Block:
    def __init__(self, block: st.FunctionBlock) -> None:
        self.name = str(block.name)
        kinds = {st.InputDeclarations: "inputs", st.OutputDeclarations: "outputs"}
        declared: dict[str, dict[str, str]] = {"inputs": {}, "outputs": {}, "own": {}}
        self.constants: dict[str, Value] = {}
        for part in block.declarations:
            table = declared[kinds.get(type(part), "own")]
            for item in part.items:
                for variable in item.variables:
                    name = str(variable.name).lower()
                    assert all(name not in known for known in declared.values()), name
                    table[name] = str(item.init.spec)
                    if (value := item.init.value) is not None:
                        self.constants[name] = _value(value, {})
        self.declared = declared
        self.statements = block.body.statements

    def run(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Values of all outputs, by name in lower case."""
        given = {name.lower(): value for name, value in values.items()} | self.constants
        assert self.declared["inputs"].keys() <= given.keys()
        with np.errstate(all="ignore"):
            for statement in self.statements:
                (target,) = statement.variables
                given[str(target.name).lower()] = _value(statement.expression, given)
        return {name: given[name] for name in self.declared["outputs"]}

    def outputs(self, routine: Routine, values: Mapping[str, Value]) -> dict[str, Value]:
        """Values of all outputs of a routine, each of the shape of the inputs."""
        found, shape = self.run(values), np.broadcast_shapes(*map(np.shape, values.values()))
        return {v.name: np.broadcast_to(found[v.name.lower()], shape) for v in routine.outputs}


def parsed(text: str) -> dict[str, Block]:
    """Function blocks of a source text, by name; it must keep to the grammar."""
    result = parse_source_code(text)
    assert result.exception is None, result.exception
    return {block.name: block for block in map(Block, result.transform().items)}


def _value(tree: Any, values: Mapping[str, Value]) -> Value:
    match tree:
        case st.Real() | st.Integer():
            return float(str(tree.value))
        case st.SimpleVariable():
            return values[str(tree.name).lower()]
        case st.ParenthesizedExpression():
            return _value(tree.expr, values)
        case st.UnaryOperation():
            function = np.logical_not if str(tree.op) == "NOT" else np.negative
            return function(_value(tree.expr, values))
        case st.BinaryOperation():
            name = OPERATORS[str(tree.op)]
            function = LOGIC.get(name) or OPERATIONS[name]
            return function(_value(tree.left, values), _value(tree.right, values))
        case st.FunctionCall():
            arguments = [_value(p.value, values) for p in tree.parameters]
            name = str(tree.name.name)
            if name == "SEL":
                condition, otherwise, then = arguments
                return np.where(condition, then, otherwise)
            return OPERATIONS[FUNCTIONS[name]](*arguments)
    raise AssertionError(f"not expected in our code: {tree!r}")


ODD = (0.0, -0.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-12)


def inputs_of(routine: Routine, ruleset: Ruleset, n: int, seed: int) -> dict[str, Value]:
    """Inputs of a routine: half in the usual range, the others anywhere in that of the sensor, at
    zero, negative, missing, or no number at all."""
    draw = np.random.default_rng(seed)
    values: dict[str, Value] = {}
    for v in routine.inputs:
        kind, _, name = v.id.rpartition(":")
        if kind == "x":
            values[v.name] = _degrees(draw, ruleset, name, n)
        elif kind == "good":
            values[v.name] = draw.random(n) > 0.03
        elif kind == "noise":
            span = abs(ruleset.signal_by_id[name].shown(1e3))
            values[v.name] = 10 ** draw.uniform(-9, -3, n) * min(span, 1.0)
        else:
            values[v.name] = _readings(draw, ruleset.signal_by_id[name], n)
    return values


def _readings(draw: np.random.Generator, signal: SignalSpec, n: int) -> Value:
    usual = signal.reference * draw.uniform(0.5, 1.5, n)
    low, high = signal.ends
    if not np.isfinite([low, high]).all():
        low, high = -2.0 * abs(signal.reference) - 1.0, 2.0 * abs(signal.reference) + 1.0
    span = high - low
    wide = draw.uniform(low - 0.1 * span, high + 0.1 * span, n)
    small = signal.reference * 10 ** draw.uniform(-12, 0, n) * draw.choice([-1.0, 1.0], n)
    odd = draw.choice(ODD, n)
    which = draw.choice(4, n, p=[0.6, 0.25, 0.12, 0.03])
    return signal.shown(np.choose(which, [usual, wide, small, odd]))


def _degrees(draw: np.random.Generator, ruleset: Ruleset, name: str, n: int) -> Value:
    fault = ruleset.fault_by_id[name]
    return np.where(draw.random(n) < 0.5, 0.0, draw.uniform(fault.lowest, fault.highest, n))


def expected(routine: Routine, ruleset: Ruleset, values: Mapping[str, Value]) -> dict[str, Value]:
    """What the plan says of the outputs, by id, NaN where it says nothing; ``valid:`` as the
    runtime decides it."""
    given = {v.id: v for v in routine.inputs}
    readings = {i: v for i, v in given.items() if i in ruleset.signal_by_id}
    fit = {i: _fit(ruleset.signal_by_id[i], v, values, given) for i, v in readings.items()}
    si = {
        i: np.where(fit[i], _si(ruleset.signal_by_id[i], values[v.name]), np.nan)
        for i, v in readings.items()
    }
    if routine.name == "undo":
        degrees = {i: values[v.name] for i, v in given.items() if i.startswith("x:")}
        names = [v.id for v in routine.outputs if not v.id.startswith("valid:")]
        found = ruleset.undo.select(tuple(names)).run({**_none(ruleset), **si, **degrees})
        for name in [n for n in found if n.startswith("q:")]:
            own = [k for k in found if k == name or k.startswith(f"d{name}:")]
            valid = np.all([np.isfinite(found[k]) for k in own], axis=0)
            found[name.replace("q:", "valid:")] = valid
        return found
    return _observed(routine, ruleset, values, given, si, fit)


def _observed(
    routine: Routine,
    ruleset: Ruleset,
    values: Mapping[str, Value],
    given: Mapping[str, Variable],
    si: Mapping[str, Value],
    fit: Mapping[str, Value],
) -> dict[str, Value]:
    u = {}
    found: dict[str, Value] = {}
    for name, reading in si.items():
        signal = ruleset.signal_by_id[name]
        lasting = systematic_u(signal, reading) + np.zeros_like(reading)
        found[f"fit:{name}"], found[f"systematic:{name}"] = fit[name], lasting
        noise = abs(signal.factor) * values[given[f"noise:{name}"].name]
        u[f"u:{name}"] = np.hypot(lasting, noise)
        if signal.valid_from is not None and signal.valid_to is not None:
            slack = limits.BEYOND_CALIBRATED * (signal.valid_to - signal.valid_from)
            beyond = (reading < signal.valid_from - slack) | (reading > signal.valid_to + slack)
            found[f"beyond:{name}"] = beyond
    ones = dict.fromkeys([*u, "u:parameters", "u:model"], 1.0)
    inputs = {"u:parameters": 1.0, "u:model": 1.0}
    plain, spread = ruleset.plan.run({**si, **ones}), ruleset.plan.run({**si, **inputs, **u})
    slopes = ruleset.undo.run({**si, **_none(ruleset)})
    observers = {o.id: o for o in ruleset.observers}
    for v in routine.outputs:
        kind, _, rest = v.id.partition(":")
        if kind in ("q", "s"):
            found[v.id] = plain[v.id]
        elif kind == "dq":
            found[v.id] = slopes[v.id]
        elif kind == "R":
            found[v.id] = plain[v.id]
            found[f"threshold:{rest}"] = limits.THRESHOLD * spread[f"u:{rest}"]
            found[f"moved:{rest}"] = np.abs(plain[v.id]) > found[f"threshold:{rest}"]
        elif kind == "valid" and rest in observers:
            found[v.id] = _valid(ruleset, rest, plain, si)
    for residual in ruleset.residuals:
        terms = [f"valid:{t.observer}" for t in residual.terms]
        if all(term in found for term in terms):
            found[f"valid:R:{residual.id}"] = np.all([found[t] for t in terms], axis=0)
    return found


def _valid(
    ruleset: Ruleset, observer: str, plain: Mapping[str, Value], si: Mapping[str, Value]
) -> Value:
    spec = ruleset.observer_by_id[observer]
    usable = np.isfinite(plain[f"q:{observer}"]) & (plain[f"q:{observer}"] > 0)
    for guard in spec.guards:
        usable = usable & (plain[guard.output] > 0)
    for name in spec.signals:
        minimum = ruleset.signal_by_id[name].minimum
        usable = usable & np.isfinite(si[name])
        if minimum is not None:
            usable = usable & (si[name] >= minimum)
    return usable


def _fit(
    signal: SignalSpec, v: Variable, values: Mapping[str, Value], given: Mapping[str, Variable]
) -> Value:
    reading = _si(signal, values[v.name])
    good = values[given[f"good:{signal.id}"].name]
    return good & (np.abs(reading) < 1e15) & ~outside_range(signal, reading)


def _si(signal: SignalSpec, value: Value) -> Value:
    with np.errstate(all="ignore"):
        return value * signal.factor + signal.offset


def _none(ruleset: Ruleset) -> dict[str, float]:
    return {n: 0.0 for n in ruleset.undo.inputs if n.startswith("x:")}


def differences(
    routine: Routine, found: Mapping[str, Value], plan: Mapping[str, Value]
) -> tuple[float, int, int]:
    """Largest difference of valid values, relative; validity flags that differ; points valid.

    A residual is a difference of flows, so it counts in units of these.
    """
    ids = {v.id: np.asarray(found[v.name]) for v in routine.outputs}
    worst, other, compared = 0.0, 0, 0
    for name, value in ids.items():
        kind, _, rest = name.partition(":")
        if name not in plan:
            continue
        if value.dtype == bool:
            other += int(np.sum(value != plan[name])) if kind in ("valid", "fit") else 0
            continue
        valid = ids.get(_judge(kind, rest), np.ones(value.shape, bool)) & np.isfinite(plan[name])
        compared += int(valid.sum())
        size = np.abs(plan[name])
        if kind == "R":
            size = np.maximum(
                size, np.max([np.abs(v) for n, v in plan.items() if n[:2] == "q:"], 0)
            )
        gap = np.abs(value - plan[name])[valid] / np.maximum(size[valid], 1e-300)
        worst = max(worst, float(np.max(gap, initial=0.0)))
    return worst, other, compared


def _judge(kind: str, rest: str) -> str:
    """Which flag says that an output may be compared."""
    if kind in ("q", "s", "dq"):
        return f"valid:{rest.partition(':')[0]}"
    if kind in ("R", "threshold"):
        return f"valid:R:{rest}"
    return f"fit:{rest}"

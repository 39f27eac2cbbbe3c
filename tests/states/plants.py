"""Small plants that store, written for a test, and an independent solution of two tanks."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.integrate import solve_ivp

from tests.conftest import ROOT
from tests.written import write_columns, write_plant

TANKS = ROOT / "plants" / "cascaded-tanks"

FEED = """\
module: feed
version: 1
title: Flow by a signal
signals:
  u: {quantity: reading, unit: V, sensor: analog-output, range: [0, 10], input: true, reference: 4}
parameters:
  k: {value: 1, unit: l/s/V, u: 0.1, title: flow by signal, source: made up}
observers:
  feed: {component: feed, Q: k*u, source: made up}
"""

STORE = """\
module: store
version: 1
title: Tank from which nothing flows, or as much as flows in
signals:
  y: {quantity: level, unit: m, sensor: tunnel-level, range: [0, 2]}
provides: {l_store: y}
states:
  h: {quantity: level, unit: cm, der: inflow/A, start: h0, low: 0, high: top, source: balance}
parameters:
  A:   {value: 2, unit: m2, u: 0.1, title: cross-section, source: made up}
  h0:  {value: 50, unit: cm, u: 1, title: level at the beginning, source: made up}
  top: {value: 10, unit: m, u: 0, fit: false, title: height of the wall, source: made up}
readings:
  y: {is: h, source: made up}
"""


def plant_in(folder: Path, modules: Mapping[str, str], connections: str = "", **types: str) -> Path:
    """A plant with module types of its own; `types` are texts by file name."""
    (folder / "kb").mkdir(parents=True, exist_ok=True)
    for name, text in types.items():
        (folder / "kb" / f"{name}.yaml").write_text(text, encoding="utf-8")
    return write_plant(folder, modules, connections)


def write_inputs(file: Path, time: Array, u: Array) -> Path:
    """A test record of the two tanks: time and voltage alone."""
    return write_columns(file, {"time [s]": time, "u [V]": u})


def random_inputs(n: int = 200, seed: int = 5) -> tuple[Array, Array]:
    """Time, s, and a voltage that steps at random, V."""
    random = np.random.default_rng(seed)
    return 4.0 * np.arange(n), np.repeat(random.uniform(0.5, 6.0, n), 7)[:n]


SHIPPED = {"k": 2.5e-6, "A": 15e-4, "a": 0.05e-4, "gain": 50.0, "h0": 0.1, "gravity": 9.81}
"""Values of the shipped types, SI, by hand; both tanks are alike."""


def two_tanks(
    time: Array, u: Array, values: Mapping[str, float] = SHIPPED, rtol: float = 1e-10
) -> Array:
    """What the lower sensor shows, V, by LSODA from sample to sample; not limited to its range."""
    v = values

    def flow(h: float) -> float:
        return v["a"] * float(np.sqrt(2.0 * v["gravity"] * max(h, 0.0)))

    def rates(_: float, h: Array, now: float) -> list[float]:
        between = flow(h[0])
        return [(v["k"] * now - between) / v["A"], (between - flow(h[1])) / v["A"]]

    states = [np.array([v["h0"], v["h0"]])]
    for begin, end, now in zip(time[:-1], time[1:], u[:-1], strict=True):
        step = solve_ivp(
            rates, (begin, end), states[-1], "LSODA", args=(now,), rtol=rtol, atol=1e-13
        )
        states.append(np.maximum(step.y[:, -1], 0.0))
    return v["gain"] * np.array(states)[:, 1]

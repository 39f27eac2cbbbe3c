"""A pump whose flow meter is a current loop, made by hand: independent of the compiler."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array

from tests.conftest import ROOT

HERE = ROOT / "tests" / "loop"
V, C, b, K2 = 10.2, 5.5, 0.3, 7.3e-6
"""Truth in ml/rev, l/h/bar, 1/K over 20 degC, bar/(l/h)^2; other than the data sheet says."""


def plant(folder: Path, more: str = "") -> Path:
    """The plant with a knowledge base of its own."""
    shutil.copytree(ROOT / "kb", folder / "kb")
    shutil.copy(HERE / "warm-loop.yaml", folder / "kb" / "modules")
    shutil.copy(HERE / "current-loop.yaml", folder / "kb" / "sensors")
    text = "plant: loop\ntitle: A warm loop\nmodules:\n  A: {type: warm-loop}\nconnections: []\n"
    (folder / "plant.yaml").write_text(f"{text}kb: kb\n{more}", encoding="utf-8")
    return folder


def readings(speed: Array, T: Array, seed: int = 1) -> dict[str, Array]:
    """Ten samples of each point, with noise; speed in rpm, T in degC."""
    # n V - C (1 + b (T - 20)) dp = sqrt(dp/k2), quadratic in sqrt(dp)
    loss, gap = 1.0 / np.sqrt(K2), C * (1.0 + b * (T - 20.0))
    root = (-loss + np.sqrt(loss**2 + 4.0 * gap * speed * V * 0.06)) / (2.0 * gap)
    flow = root * loss
    random = np.random.default_rng(seed)

    def noisy(values: Array, noise: float) -> Array:
        repeated = np.repeat(values, 10)
        return repeated + noise * random.standard_normal(len(repeated))

    return {
        "A.n [rpm]": noisy(speed, 0.1),
        "A.dp [bar]": noisy(root**2, 5e-4),
        "A.T [degC]": noisy(T, 0.02),
        "A.I_Q [mA]": noisy(4.0 + flow / 62.5, 1e-3),
    }


def write(path: Path, columns: dict[str, Array]) -> Path:
    """One sample a second."""
    names = ",".join(["time [s]", *columns])
    rows = np.column_stack([np.arange(len(next(iter(columns.values())))), *columns.values()])
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.9g")
    return path


def run_in(folder: Path, varied: bool = True) -> Path:
    """A recording for calibration; its temperature stands unless `varied`."""
    speed = np.linspace(500.0, 1400.0, 30)
    T = 20.0 + 5.0 * (7 * np.arange(30) % 10) if varied else np.full(30, 40.0)
    return write(folder / "run-in.csv", readings(speed, T))

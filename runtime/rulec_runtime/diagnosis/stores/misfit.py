"""The usual misfit of balances, so that only an unusual one counts.

The model of a real plant is off by more than noise, and equally for many samples. The recording
itself shows how far: the error that a window without a fault usually leaves, and its correlation
time, set the weight of each reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.judge_windows import Judge, Judged
from rulec_runtime.diagnosis.stores.window_fit import Model, model_of
from rulec_runtime.diagnosis.stores.windows import Windows
from rulec_runtime.recordings.robust_statistics import memory_of


@dataclass(frozen=True)
class Weighed:
    """All windows of a recording judged, and the usual misfit of each output, SI, shape
    (outputs,)."""

    windows: Windows
    judge: Judge
    judged: Sequence[Judged]
    misfit: Array

    @property
    def model(self) -> Model:
        """The balances, each reading with its weight."""
        return self.judge.model


def weighed(ruleset: Ruleset, windows: Windows) -> Weighed:
    """Find the usual misfit, and judge all windows with it."""
    model = model_of(ruleset, windows.noise, windows.level)
    alone = Judge(model, np.ones(len(windows.noise)), ()).judge(windows.members, learning=False)
    misfit, memory = _left(alone, windows.noise)
    left = limits.LARGEST_MISFIT**2
    for last in range(limits.MISFIT_PASSES + 1):
        weights = replace(model, spread=misfit * np.sqrt(memory))
        judge = Judge(weights, 1.0 / memory, model.dynamics.faults)
        judged = judge.judge(windows.members)
        ratios = [j.chi / j.freedom for j in judged if j.plain is not None]
        more = min(float(np.quantile(ratios, limits.USUAL_MISFIT)) if ratios else 0.0, left)
        if more < limits.MISFIT_TOO_SMALL or last == limits.MISFIT_PASSES:
            break
        left /= more
        misfit = misfit * np.sqrt(more)
    return Weighed(windows, judge, judged, misfit)


def _left(judged: Sequence[Judged], noise: Array) -> tuple[Array, Array]:
    """Robust standard deviation and correlation time of the residuals of each output."""
    errors = [j.plain.error for j in judged if j.plain is not None]
    misfit, memory = noise.copy(), np.ones(len(noise))
    for i in range(len(noise)):
        own = [(e[:, i], np.isfinite(e[:, i])) for e in errors if np.isfinite(e[:, i]).any()]
        if own:
            spreads = [float(np.sqrt(np.mean(e[known] ** 2))) for e, known in own]
            misfit[i] = max(float(np.quantile(spreads, limits.USUAL_MISFIT)), noise[i])
            lags = [memory_of(e, known) for e, known in own]
            found = float(np.quantile(lags, limits.USUAL_MISFIT))
            memory[i] = found if found > limits.SLOW_ERROR else 1.0
    return misfit, memory

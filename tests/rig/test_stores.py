"""Real recordings of plants that store: what the comparison found holds on blocks it never used.

The whole search takes minutes (`rulec mismatch`); here the explanations it found are fitted anew.
"""

import numpy as np
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.failing_sensors import failing
from rulec.mismatch.evidence.stores.fit import Fitted, plain_end, refit
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem, record_of
from rulec.mismatch.search.simulated import begun
from tests.conftest import ROOT
from tests.rig import real
from tests.runtime.mismatch.dynamic.problems import grow_by


def fitted(plant: str, file: str, *sets: tuple[str, ...]) -> tuple[SimulationProblem, list[Fitted]]:
    """The recalibrated model and those repaired by sets, on the blocks that are open."""
    ruleset, builder = open_builder(ROOT / "plants" / plant)
    record = record_of(read_recording(real(file), ruleset), ruleset, builder.given)
    assert record is not None
    problem = SimulationProblem(ruleset, builder, record)
    search = begun(problem)
    grow_by(search, *set().union(*sets))
    plain = plain_end(problem, search.models[frozenset()].setting.values)
    found = [plain]
    for joined in sets:
        setting = search.models[frozenset(joined)].setting
        found.append(refit(plain, setting.joined, {**setting.values, **setting.fixed}))
    return problem, found


def heldout(problem: SimulationProblem, model: Fitted, signal: str) -> float:
    """Root mean square error on held-out blocks, SI."""
    error = model.errors[signal][~problem.record.open]
    return float(np.sqrt(np.nanmean(error**2)))


def test_cascaded_tanks() -> None:
    """A bent transmitter and an overflow hide each other: alone next to nothing, together most."""
    bend, rim = "lower.bent-characteristic@y", "upper.overflow-caught@inflow"
    file = "cascaded-tanks/estimation.csv"
    problem, models = fitted("cascaded-tanks", file, (bend,), (bend, rim))
    errors = [heldout(problem, model, "lower.y") for model in models]
    assert errors[0] > 0.6
    assert errors[1] > 0.9 * errors[0]
    assert errors[2] < 0.3


def test_two_tanks_and_a_gravity_pipe() -> None:
    """An overflow of tank 2 and the delay of the pipe; the bad level sensor of the pipe is told."""
    file = "aau-wastewater-lab/onoff_2021-12-30.csv.gz"
    joined = ("tank2.overflow-lost@inflow", "pipe.transport-delay@outflow")
    problem, (plain, repaired) = fitted("wastewater-lab", file, joined)
    assert heldout(problem, plain, "tank2.l") > 0.025
    assert heldout(problem, repaired, "tank2.l") < 0.015
    assert 30.0 < repaired.values["pipe.transport-delay@outflow.tau"] < 70.0
    assert 0.55 < repaired.values["tank2.overflow-lost@inflow.l_o"] < 0.65
    faults = list(failing(read_recording(real(file), problem.ruleset), problem.ruleset))
    assert ["pipe.l2.drop-outs"] == [finding.id for finding in faults]

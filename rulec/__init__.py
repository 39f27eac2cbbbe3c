"""Fault diagnosis for modular hydraulic plants: the commands as functions.

>>> import rulec
>>> found = rulec.diagnose("plants/abc", "plants/abc/examples/healthy.csv")
>>> found.status
'ok'

Functions are loaded when they are first asked for, so that `import rulec` costs next to nothing.
Reading order of the compiler: `passes/pipeline.py` names the passes; each is a file of that name.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rulec_runtime.contract.ruleset_file import RulesetRefused
    from rulec_runtime.output.refusal import Misused, Refusal
    from rulec_runtime.recordings.csv_table import RecordingRefused

    from rulec.calibration.fit import CalibrationRefused
    from rulec.commands.adopt import AdoptResult, adopt
    from rulec.commands.calibrate import CalibrateResult, LearnResult, calibrate, learn
    from rulec.commands.compile import CompileResult, compile
    from rulec.commands.diagnose import DiagnoseResult, diagnose
    from rulec.commands.experiment import ExperimentResult, experiment
    from rulec.commands.mismatch import MismatchResult, mismatch
    from rulec.commands.result import FrameRefused
    from rulec.commands.simulate import SimulateResult, simulate
    from rulec.commands.study import study
    from rulec.commands.study_result import StudyResult
    from rulec.effects.repair import AdoptRefused
    from rulec.language.diagnostics import Refused
    from rulec.mismatch.result import ExperimentRefused, MismatchRefused
    from rulec.simulation.equations import SimulationRefused

__all__ = [
    "AdoptRefused",
    "AdoptResult",
    "CalibrateResult",
    "CalibrationRefused",
    "CompileResult",
    "DiagnoseResult",
    "ExperimentRefused",
    "ExperimentResult",
    "FrameRefused",
    "LearnResult",
    "MismatchRefused",
    "MismatchResult",
    "Misused",
    "RecordingRefused",
    "Refusal",
    "Refused",
    "RulesetRefused",
    "SimulateResult",
    "SimulationRefused",
    "StudyResult",
    "adopt",
    "calibrate",
    "compile",
    "diagnose",
    "experiment",
    "learn",
    "mismatch",
    "simulate",
    "study",
]

_PLACES = {
    **{
        name: f"rulec.commands.{name.removesuffix('Result').lower()}"
        for name in __all__
        if name.endswith("Result") or name.islower()
    },
    "LearnResult": "rulec.commands.calibrate",
    "StudyResult": "rulec.commands.study_result",
    "learn": "rulec.commands.calibrate",
    "AdoptRefused": "rulec.effects.repair",
    "CalibrationRefused": "rulec.calibration.fit",
    "ExperimentRefused": "rulec.mismatch.result",
    "FrameRefused": "rulec.commands.result",
    "MismatchRefused": "rulec.mismatch.result",
    "Misused": "rulec_runtime.output.refusal",
    "RecordingRefused": "rulec_runtime.recordings.csv_table",
    "Refusal": "rulec_runtime.output.refusal",
    "Refused": "rulec.language.diagnostics",
    "RulesetRefused": "rulec_runtime.contract.ruleset_file",
    "SimulationRefused": "rulec.simulation.equations",
}


class _Rulec(ModuleType):
    """`rulec.mismatch` and `rulec.study` are functions, although packages of these names are
    imported behind them."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PLACES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Rulec


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module 'rulec' has no attribute '{name}'")
    value: object = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

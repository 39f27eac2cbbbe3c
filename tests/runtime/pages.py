"""A page of every kind, small and quickly made, with the verdict that it must have as heading."""

import dataclasses

import numpy as np
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.verdict import verdict

from rulec.commands.matrix import matrix_page
from rulec.commands.matrix import verdict as matrix_verdict
from rulec.commands.study_result import StudyResult
from rulec.mismatch.answer.terminal_and_page import report as mismatch_report
from rulec.mismatch.answer.terminal_and_page import verdict as mismatch_verdict
from rulec.mismatch.experiment.recipe import experiment_page
from rulec.mismatch.result import Mismatch
from rulec.prove.page import headline as prove_headline
from rulec.prove.page import page as prove_page
from rulec.prove.scores import table
from rulec.study.campaign import Settings
from rulec.study.points import Points
from rulec.study.summary import verdict as study_verdict
from tests.conftest import compiled
from tests.prove.made import run
from tests.runtime.mismatches import ALL, made_by_hand
from tests.runtime.reports import EXAMPLES, Judged, judge
from tests.test_study import TYPES, counted

MADE = Made("2026-09-22 08:15 UTC", "rulec 1.2.3")

CALENDAR = Calendar(1789948760.0, ((0.0, 7200.0),))
"""Time 0 is 2026-09-21 01:59:20 in a zone two hours before UTC."""


def subject() -> Subject:
    return Subject(ruleset=compiled("abc"), recording="warm.csv", samples=400, ends=(0.0, 399.0))


def mismatch_page(mismatch: Mismatch) -> str:
    return mismatch_report(mismatch, subject(), MADE)


def dated(judged: Judged) -> Judged:
    return dataclasses.replace(
        judged,
        recording=dataclasses.replace(judged.recording, calendar=CALENDAR),
        diagnosis=dataclasses.replace(judged.diagnosis, calendar=CALENDAR),
    )


def every_page() -> dict[str, tuple[str, str]]:
    abc = compiled("abc")
    leaking = dated(judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv"))
    healthy = judge(EXAMPLES / "healthy.csv", abc)
    points = Points({"A.n": np.array([10.0]), "B.n": np.array([10.0])})
    study, proof, experiment = counted(), run(60), made_by_hand()
    of_study = StudyResult(
        ruleset=abc, types=TYPES, points=points, settings=Settings(), counts=study
    )
    return {
        "diagnosis": (leaking.page("leakage_A.csv"), verdict(leaking.diagnosis)),
        "healthy": (healthy.page("healthy.csv"), verdict(healthy.diagnosis)),
        **{
            f"mismatch {name}": (mismatch_page(one), mismatch_verdict(one)[0])
            for name, one in ALL.items()
        },
        "experiment": (
            experiment_page(experiment, abc, MADE),
            experiment.headline.removesuffix("."),
        ),
        "study": (of_study.page(MADE), study_verdict(study)),
        "matrix": (matrix_page(abc, MADE), matrix_verdict(abc)),
        "proof": (prove_page(proof, MADE), prove_headline(proof, table(proof.judged))),
    }

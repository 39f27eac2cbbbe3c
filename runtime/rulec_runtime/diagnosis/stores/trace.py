"""A verdict for every sample of a plant that stores: that of the window in whose middle it is."""

from __future__ import annotations

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.traced import Trace
from rulec_runtime.diagnosis.stores.diagnose import StoresJudged
from rulec_runtime.recordings.recording import Recording


def trace_stores(recording: Recording, ruleset: Ruleset, said: StoresJudged) -> Trace:
    """Words and degrees per sample."""
    judged = said.weighed.judged
    words = ["cannot judge"] * len(recording)
    degree = np.zeros((len(ruleset.faults), len(recording)))
    half = np.zeros_like(degree)
    row = {f.id: i for i, f in enumerate(ruleset.faults)}
    if judged:
        middles = np.array([one.window.middle for one in judged])
        order = np.argsort(middles, kind="stable")
        edges = 0.5 * (middles[order][1:] + middles[order][:-1])
        nearest = order[np.searchsorted(edges, recording.time)]
        for sample in np.flatnonzero(said.covered).tolist():
            one = judged[int(nearest[sample])]
            if one.plain is not None:
                words[sample] = "ok"
            for name, test in one.tests.items():
                if test.fits:
                    degree[row[name], sample] = test.degree
                    half[row[name], sample] = limits.COVERAGE * test.u
    for period in said.found.unknown:
        _say(words, recording, period.since, period.until, "unknown")
    for finding in said.found.findings:
        _say(words, recording, finding.since, finding.until, finding.fault.id)
    lower = np.maximum(degree - half, 0.0)
    return Trace(recording.time, tuple(words), degree, lower, degree + half, tuple(row))


def _say(words: list[str], recording: Recording, since: float, until: float, word: str) -> None:
    for i in np.flatnonzero((recording.time >= since) & (recording.time <= until)).tolist():
        if words[i] != "cannot judge":
            words[i] = word

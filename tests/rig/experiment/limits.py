"""Numbers that decide in the experiment; each with its meaning and its origin."""

from __future__ import annotations

from rulec.mismatch.limits import (
    BAND_WIDTH,
    BANDS,
    COMMON,
    FEATURE_VARIES,
    HALF_STEPS,
    SAME_PATTERN,
)

__all__ = ["BANDS", "BAND_WIDTH", "COMMON", "FEATURE_VARIES", "HALF_STEPS", "SAME_PATTERN"]
"""Numbers of today's search that serve here too."""

ALIKE_SHARE = 0.03
"""Inputs of one operating state agree within this share of their range. Origin: assumed."""

ALIKE_NOISE = 4.0
"""Or within this many times their noise. Origin: assumed."""

FEWEST_VISITS = 6
"""Differences between visits to states from which the noise of means is told. Origin: assumed."""

FORM_LENGTH = 0.3
"""Distance of inputs, as share of their range, over which errors of form are alike. Origin:
assumed."""

STUDENT = 4.0
"""Degrees of freedom of errors of points and of stated calibrations. Origin: source (Lange, Little,
Taylor 1989, as is usual)."""

FORM_SHARES = (1e-5, 0.001, 0.002, 0.004, 0.008, 0.015, 0.03, 0.06)
"""Errors of form that are tried, as share of an output's usual size. Origin: numerical."""

USUAL_FORM = 0.01
"""Usual error of form of a law, as that share: formulas of pumps and lines hold to about 1 %.
Origin: assumed."""

FORM_KNOWN = 3.0
"""Factor to which that is known before. Origin: assumed."""

FORM_RANK = 1e-3
"""Share of the largest variance below which a smooth course is left out. Origin: numerical."""

MOVING_SHARES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""How far errors of sensors move within their class while a recording runs, as share of their
standard uncertainty, that are tried. Origin: numerical."""

USUAL_MOVING = 0.2
"""The usual one of these: most of a sensor's class is an error that stays. Origin: assumed."""

MOVING_KNOWN = 3.0
"""Factor to which that is known before. Origin: assumed."""

FORM_NOT_SEEN = 0.3
"""Standard deviations of the noise below which an error of form is not carried along. Origin:
numerical."""

NOISE_SCALES = (0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.2, 3.0)
"""Sizes of the noise that are tried, in units of what was expected. Origin: numerical."""

NOISE_KNOWN = 1.5
"""Factor to which the size of the noise is known before. Origin: assumed."""

EFFECT_FORM = 0.03
"""Usual error of form of an effect's own law, as share of what it changes. Origin: assumed."""

TERM_SIZES = (1.0, 3.0, 10.0, 30.0, 95.0, 300.0, 950.0, 3000.0)
"""Sizes of terms without a name that are tried, in units of the noise of a point. Origin:
numerical."""

TERM_FUNCTIONS = 6
"""Smooth functions of a driver that a term without a name may hold. Origin: numerical."""

TERM_LENGTH = 0.4
"""Distance, as share of a driver's range, over which a term without a name is alike. Origin:
assumed."""

TERM_ODDS = -1.0
"""Log odds of a term without a name against a law. Origin: assumed."""

SORT_ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0}
"""Log odds of each sort of explanation before the recording. Origin: assumed."""

LET_GO_ODDS = -2.0
"""Log odds of a calibration that no longer holds. Origin: assumed."""

ONSETS = 23
"""Times at which a fault may begin that are tried at first. Origin: numerical."""

WIDER = 3.0
"""Factor by which an amplitude may be larger beside others than alone, when what it would gain is
told to first order. Origin: numerical."""

PAIRED_COLUMNS = 500
"""Columns of which all pairs are scanned: those that gain most alone. Origin: numerical."""

FIRST_SETS = 40
"""Single explanations that are refitted at first: far from a model a slope says little of what a
large effect would gain. Origin: numerical."""

WORTH_A_REFIT = -2.0
"""Log odds to first order from which on a set is refitted. Origin: numerical."""

SETS_GROWN = 2
"""Sets that are grown in a round. Origin: numerical."""

ROUNDS = 8
"""Rounds in which sets are grown. Origin: numerical."""

LARGEST_SET = 5
"""Most explanations that are named together. Origin: assumed."""

SETS_REFITTED = 12
"""Sets that are refitted of each that is grown. Origin: numerical."""

TERMS_REFITTED = 3
"""Terms without a name that are refitted of each set that is grown. Origin: numerical."""

ONSET_STEPS = (4, 2, 1)
"""Points by which an onset is moved, in turn, as long as that is likelier. Origin: numerical."""

ONSET_POINTS = 9
"""Points at which the onset of a fault is looked for in the end. Origin: numerical."""

LEAST_GAIN = 0.01
"""Gain of what is told although a set without it is as likely, nats: shares need a number above
nothing. Origin: numerical."""

LIKELIER = 0.5
"""Probability from which on a member of the best set is told. Origin: source (Barbieri and Berger
2004, median probability model)."""

WORTH_A_CUT = 20.0
"""Gain of a fault that comes and goes from which on means are cut at its ends, nats. Origin:
numerical."""

MOST_MEANS = 150
"""Means of states, about, that stand for a recording: as many pieces of evidence as its operating
points are, not as its samples. Origin: assumed."""

SAME_FLOW = 0.3
"""Share by which a reading may differ from an estimate of the flow of its module and be
one. Origin: assumed."""

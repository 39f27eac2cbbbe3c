"""Numbers that decide what the compiler and what stands on it find, each with its origin."""

UNSURE = 3
"""Exit code of `mismatch` where something is or may be missing, and the recording does not tell
what. Origin: assumed, as `--fail-on` of `watch` has it."""

# Reading files

MAX_FILE_BYTES = 1_000_000
"""Bytes of a file of knowledge or of a plant; longer ones are refused. Origin: assumed."""

KEPT_DOCUMENTS = 2048
"""Documents, and what was read of them, that one process keeps: six times the library.

Origin: assumed."""

# Equations

MULTIPLIED_POWER = 8
"""Whole exponent up to which a power is calculated as a product. Origin: assumed."""

# Knowledge

ASSUMED_ACCURACY = 0.05
"""Share of what it predicts within which a law keeps that states no accuracy. ISO 9906 grade 2B
lets the head of a pump differ by as much, and textbook laws of friction scatter by about that.
Origin: assumed."""

FAR_READING = 50.0
"""Ratio of the median of a recorded reading to the typical one, beyond which `rulec check` asks for
its unit. As FAR_ESTIMATES. Origin: assumed."""

BELIEF_FREEDOM = 3.0
"""Degrees of freedom of what is believed of a parameter: sheets and calibrations are wrong now and
then, and by more than a normal distribution allows. Origin: source (Lange, Little, Taylor 1989, as
is usual)."""

STRAINED = 2.0
"""Standard uncertainties off its sheet from which on a parameter is told. Origin: distribution
(normal, two-sided, 5 %)."""

UNBELIEVABLE = 3.0
"""Standard uncertainties off its sheet beyond which a value is not believed. Origin: distribution
(normal, two-sided, 0.3 %)."""

# Algebra

ZERO_PIVOT = 1e-9
"""Entries of eliminated balances below this are rounding; balances have entries of about 1. Origin:
numerical."""

# Signatures, rules and isolability

MOST_RULES = 24
"""Rules of a fault: of the residuals that it moves, those that show it at the smallest degree.
Shipped plants have 14 at most. Origin: assumed, so that long chains compile
(`pytest tests/bench/test_compile.py`)."""

SAME_DIRECTION = 1.0 - 1e-9
"""Cosine between signatures from which on two faults coincide. Origin: numerical."""

SEPARATED = 4.0
"""Standard deviations that tell two faults apart: two expanded uncertainties. Origin: standard
(GUM, coverage factor 2 for each of the two)."""

# Calibration

FAR_POINT = 5.0
"""Robust standard deviations beyond which a point is set aside. Origin: distribution (normal, two-
sided 5.7e-7)."""

POINTS_PER_PARAMETER = 3
"""Settled points that each fitted parameter needs. Origin: assumed."""

UNTOLD = 0.9
"""Share of the uncertainty by its sheet that a parameter keeps at least of which a recording tells
next to nothing. Origin: assumed."""

# A step that tells faults apart

SAME_FLOW = 0.01
"""Change of a flow, in itself, up to which it stays the same: what a controller holds. Origin:
assumed."""

ADOPTED_AGREEMENT = 1e-3
"""Share by which an error of the adopted plant may differ from the one reported: digits in files,
and solvers. Origin: assumed."""

# Engines ---------------------------------------------------------------------------------------

WORK_AHEAD = 2
"""Calls that wait for each process, so that none is idle. Origin: assumed."""

WORKER_DEATHS = 3
"""Processes that die at a call before it is given up. Origin: assumed, as dask.distributed
has it."""

SCHEDULER_CONNECT = 20
"""Seconds to wait for a scheduler. Origin: assumed."""

# Column maps -----------------------------------------------------------------------------------

MOST_QUESTIONS = 8
"""Questions that a file can raise; more would be the same one again. Origin: numerical."""

SENTINEL = 2
"""How often a number has to stand far outside a range to be one that means missing. Origin:
assumed."""

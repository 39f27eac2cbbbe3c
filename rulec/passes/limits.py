"""Numbers that decide in the compiler. Origins as in `rulec/limits.py`."""

ABSURD_FAULT = 4.0
"""Geometric standard deviations above the usual degree of a fault from which on nobody would
believe it. Origin: distribution (normal, one-sided, 3e-5)."""

DIGITS = 9
"""Significant digits of figures at the reference point. Origin: numerical, fewer than a solver's
last ones."""

FORM_COMMON = 0.61
"""Share of the variance of a law's form that two of its points have in common; the rest is new at
each. Origin: distribution (points spread evenly over the range of a Gaussian process whose length
is a third of it, as in `rulec mismatch`)."""

LIQUID_SEEN = 0.05
"""Share of the largest shift of a residual by a change of the liquid from which on another one is
expected to move as well. Origin: assumed; what it moves less follows laws known to a factor."""

# Reference point

REFERENCE_STEPS = 40
"""Newton steps at most. Origin: assumed."""

REFERENCE_HALVINGS = 8
"""Halvings of a Newton step behind which a flow has no value. Origin: assumed."""

REFERENCE_DAMPING = 0.3
"""Largest Newton step, as a share of each reading's own scale. Origin: assumed."""

REFERENCE_STEP = 1e-9
"""Newton step, as a share of each reading's own scale, below which the point stands. Origin:
numerical."""

FLOW_COST = 1e-14
"""Cost of a flow over that of a reading, each in its own scale: the step must be unique. Origin:
numerical."""

SADDLE_RIDGE = 1e-14
"""Taken off the lower diagonal block of the least-length system, which may be singular. Origin:
numerical."""

VANISHED_RESIDUAL = 1e-6
"""Share of the largest flow below which a residual counts as zero. Origin: numerical."""

# Signatures, rules and isolability

NEGLIGIBLE_EFFECT = 1e-6
"""Share of the flow below which an effect counts as none: it cancels at a fault-free point. Origin:
numerical."""

IMMOVABLE = 1e-9
"""Share of a flow below which a reading moves nothing any more. Origin: numerical."""

MOST_SUMMED = 24
"""Modules whose flows one residual adds up at most, unless as many meet at one place; beyond it,
what flows in is compared at each junction on the way, by those nearest to it, which tells the same:
far sums follow from near ones. Shipped plants add up five at most. Origin: assumed, so that long
chains compile (`pytest tests/bench/test_compile.py`)."""

LONG_SUM = 3
"""Sums of more gradients than this are gathered first; it decides the size of the plan only.
Origin: assumed."""

MANY_CORRELATED = 8
"""Observers in a residual beyond which its own gradient is the shorter one. Origin:
assumed."""

LEAST_SPREAD = 1e-9
"""Least standard uncertainty of a residual, as a share of the largest: nothing is known exactly.
Origin: numerical."""

ROUNDED_AWAY = 1e-9
"""Share of a fault's squared distance below which it is rounding, and another fault imitates it.
Origin: numerical."""

SMALL_DEGREE = 0.2
"""Degree, as a share, at which faults should be told apart; beyond it they count as alike. Origin:
assumed."""

SEEN = 2.0
"""Multiple of the degree that shows a fault at which advice may leave one that is hard to see.
Origin: assumed."""

WIDE_JUNCTION = 30
"""At junctions of more modules than this, pairs of faults of different modules are not listed:
their number grows with the square. Origin: assumed."""

FAR_READERS = 6
"""Of modules further away that read a signal of a module, so many nearest ones are looked at.
Origin: assumed."""

SHORT_LAW = 60
"""Characters up to which a plain law with drivers replaced stands inside the new law. Origin:
assumed."""

MAX_STEM = 36
"""Characters of a name that a number may follow; names have 41 at most. Origin: assumed."""

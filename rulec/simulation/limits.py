"""Numbers that decide in simulation. Origins as in `rulec/limits.py`."""

NEWTON_CONVERGED = 1e-7
"""Last step, in units of the unknowns' scales. Origin: numerical; Newton squares it, so the result
is better."""

SHRINKS = 0.5
"""Each step over the one before, at most, where a solution is near. Origin: source, natural
monotonicity test, Deuflhard 2004, Newton Methods for Nonlinear Problems, sec. 3.3."""

FIRST_SHARE = 0.25
"""Share of the way from the reference point that is tried first. Origin: numerical."""

SHORTEST_SHARE = 1.0 / 65536.0
"""Share of the way below which the way counts as ended. Origin: numerical."""

NO_FLOW = 1e-4
"""Share of the reference flow that stands for none. Pressures and torques change by less than this
share between it and zero. Origin: numerical, above `SHORTEST_SHARE`."""

GAP_STEPS = 10_000
"""Steps in a gap of the recording at most; with inputs that stand still all has settled by then.
Origin: assumed."""

SAME_EFFECT = 1e-6
"""Effects are alike if they differ by less than this share when scaled to each other. Origin:
numerical."""

FIRST_SAMPLES = 10
"""First samples of a recording that tell where what is stored starts. Origin: assumed."""

FIRST_ORDER = 2
"""Highest order of the curve that is put through them. Origin: numerical."""

START_STEPS = 20
"""Gauss-Newton steps to the start of what is stored. Origin: numerical."""

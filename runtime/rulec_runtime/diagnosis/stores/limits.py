"""Numbers that decide in plants that store. Origins as in `rulec_runtime/limits.py`."""

# Plants that store -------------------------------------------------------------------------------

SAMPLES_FITTED = 4096
"""Samples of a recording at most; neighbours of longer recordings are averaged. Origin: assumed."""

WINDOWS_SIDE_BY_SIDE = 8
"""Windows that a recording is cut into, where that leaves them long enough. Origin: assumed."""

SHORT_WINDOW, LONG_WINDOW = 48, 256
"""Samples of a window at least, where a recording has them, and at most. Origin: assumed."""

FEWEST_IN_WINDOW = 24
"""Samples without a pause below which nothing is judged. Origin: assumed."""

PAUSE_STORES = 20.0
"""Sampling intervals without a sample that balances cannot be followed across: what is given may
have been anything. Origin: assumed."""

WINDOW_COMPLETE = 0.8
"""Share of the samples of a window in which given readings, and some measured one, must be there.
Origin: assumed."""

SAMPLES_A_JUMP = 8
"""Samples of a window per jump of an input at least; what changes more often has no jumps. Origin:
assumed."""

MOST_OF_ALL = 0.9
"""Share of the squares of all changes of an input that its jumps make up. Origin: assumed."""

USUAL_MISFIT = 0.4
"""Share of windows whose misfit counts as usual: less than half, as a fault may begin in the
middle. Origin: assumed."""

LOW_MISFIT = 0.1
"""Share of windows whose misfit is low; how far it is from the usual one tells how uneven misfits
are. Origin: assumed."""

ONE_IN_TWENTY = 0.95
"""Share of windows without a fault whose misfit is expected. Origin: standard (95 %)."""

MISFIT_PASSES = 4
"""Times at most that the usual misfit is raised. Origin: numerical."""

MISFIT_TOO_SMALL = 1.1
"""Chi-square over freedom from which on the usual misfit was taken too small. Origin: assumed."""

LARGEST_MISFIT = 5.0
"""Factor by which the misfit of windows that know of each other may exceed that of windows on their
own: beyond it, something is wrong in most of them. Origin: assumed."""

BEHIND_A_MISFIT = 2.0
"""Factor by which one degree of a fault in all windows must lower the usual misfit to be what is
behind it. Origin: assumed, three quarters of chi-square."""

SLOW_ERROR = 1.5
"""Correlation length, in samples, from which on an error counts as slow. Origin: assumed."""

REMARKABLE_MISFIT = 1.5
"""Usual misfit over noise from which on it is worth a remark. Origin: assumed."""

LEAST_GAIN = 0.1
"""Share of the largest gain, to first order, from which on a fault may be what began. Origin:
assumed."""

SAMPLES_OF_A_LAW = 16
"""Samples between which a fault may depart from its law differently. Origin: assumed."""

ROUNDS_OF_LAW = 2
"""Refits of the beginning of a fault with its departures from its law. Origin: numerical."""

NEAR = 8
"""Samples by which the beginning of a fault may move when it is fitted. Origin: numerical."""

EDGE_TIMES = 32
"""Times that are tried for the beginning or the end of a fault. Origin: assumed."""

UNDETECTABLE_EFFECT = 1e-9
"""Share of a fault's effect that is left beside all errors below which it shows nothing. Origin:
numerical."""

SMALLEST_START, LARGEST_START = 0.02, 0.5
"""Degrees between which a fit of a fault starts; the largest as a share of the highest. Origin:
numerical."""

WINDOWS_IN_A_ROW = 3
"""Windows over which a finding must hold: the first and the last of them share no sample. Origin:
assumed."""

FITS_MOST = 0.8
"""Share of windows that a fault must fit in to explain all of them. Origin: assumed."""

EVIDENCE_DECIMALS = 2
"""Decimals of log-likelihoods: faults that a fit tells apart by less are named in their order.
Origin: numerical, windows are fitted no closer."""

LEAST_U_STORES = 1e-9
"""Standard uncertainty of a degree in a window at least, where it weights a mean. Origin:
numerical."""

WINDOW_STEPS = 40, 1e-5
"""Levenberg-Marquardt steps of a fit at most, and the share of chi-square by which a step must
lower it to be worth another: what is far off is not worth the last one. Origin: numerical."""

WINDOW_SETTLED = 1e-2
"""A fit ends when chi-square falls by less than this. Origin: numerical."""

FAR_OFF, STEPS_FAR_OFF = 3.0, (8, 0.03)
"""Misfit, in standard deviations of the readings, beyond which these count less, which is also the
factor by which it falls from round to round; steps of a round, as above. Origin: numerical."""

NO_CLOSER = 0.9
"""Share of the misfit that a round leaves from which on no fit is near. Origin: numerical."""

LARGEST_EXPONENT = 50.0
"""Logarithm of a factor on a parameter at most. Origin: numerical."""

FIRST_DAMPING, LESS_DAMPING, MORE_DAMPING, LARGEST_DAMPING = 1e-3, 0.2, 8.0, 1e6
"""Damping of the first step of a fit, the factors on it after a step that led on and after one that
led away, and the damping beyond which no step leads on. Origin: numerical."""

LARGEST_CHI_SQUARE = 1e15
"""Chi-square beyond which a course says nothing. Origin: numerical."""

LEAST_CURVATURE = 1e-12
"""Share of the largest curvature by which none is smaller: keeps matrices regular. Origin:
numerical."""

SIGNATURE_SAMPLES, SIGNATURE_STEP = 400, 2.0
"""Samples of the course in which effects of faults are compared, and seconds between them. Origin:
assumed."""

SIGNATURE_SWING, SIGNATURE_PACE, SIGNATURE_PACES_APART = 0.2, 40.0, 17.0
"""Share of its reference by which each given reading swings in that course, seconds per radian of
the first of them, and by how many each further one is slower. Origin: assumed."""

KNOTS = 4
"""Values over the range of a law between which its form may be off. Origin: assumed, a correlation
length of 0.3 of the range."""

NEW_FORM = 0.03
"""Share of the variance of a law's form that lines between these values leave. Origin: distribution
(a Gaussian process whose length is 0.3 of the range)."""

UNIFORM = 3.0**-0.5
"""Root mean square of the time from a sample to a moment before the next one, as a share of the
time between them. Origin: distribution, uniform."""

SAMPLES_OF_NOISE = 8
"""Samples of an input whose noise is one error: balances sum it up. Origin: numerical."""

SLIGHT_ERROR = 0.1
"""Standard deviations of a reading below which an error of an input does not count. Origin:
numerical."""

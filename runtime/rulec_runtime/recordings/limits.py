"""Numbers that decide how recordings are read. Origins as in `rulec_runtime/limits.py`."""

# Memory ----------------------------------------------------------------------------------------

IN_MEMORY = 2**20
"""Bytes of an array up to which it stays in memory; larger ones lie in a file. Origin: numerical,
what is found is the same."""

PIECE = 2**20
"""Bytes of a file that are read at a time. Origin: numerical, what is read is the same."""

PARQUET_ROWS = 2**16
"""Rows of a Parquet file that are read at a time. Origin: numerical, what is read is the same."""

PARQUET_BUFFER = 2**17
"""Bytes of each column of a Parquet file that are read at a time. Origin: numerical, what is read
is the same."""

# Reading files ---------------------------------------------------------------------------------

LARGEST_PIPE = 2**30
"""Bytes from standard input at most, which stay in memory. Origin: assumed; longer ones can be kept
in a file, which need not stay there."""

LONGEST_LINE = 2**24
"""Bytes of a line of a CSV file at most. Origin: assumed; 50 000 numbers need a megabyte."""

MOST_COLUMNS = 50_000
"""Columns of a table at most. Origin: assumed; the largest plants have some thousand signals."""

LONGEST_UNIT = 40
"""Characters of a unit at most. Origin: assumed."""

LARGEST_POWER = 6
"""Exponent of a unit at most. Origin: assumed."""

FREE_TO_UNPACK = 100_000_000
"""Bytes that any packed recording may unpack to. Origin: assumed; 300 MB take a second."""

DENSEST = 100
"""Times its own size that a packed recording may unpack to. Origin: assumed; recordings pack to
between a third and a twentieth."""

LINES_ABOVE_TITLES = 60
"""Lines above the titles of a table at most: what a logger tells of itself. Origin: assumed."""

MOST_OBJECTS = 10_000
"""Groups and data sets of a file at most that are looked at. Origin: assumed; loggers write some
thousand channels."""

MOST_IN_TREE = 20
"""Levels of groups or structures in a file at most. Origin: assumed."""

GOOD_QUALITY = 192
"""Quality of a reading in a historian from which on it is good. Origin: standard, OPC Data Access:
the upper two of its eight bits are set."""

FEW_TEXTS = 10_000
"""Different texts of a column of which one copy each is kept. Origin: numerical."""

COLUMNS_OF_LONG = 10
"""Columns at most of a table that has a reading a row, where no column map says so. Origin:
assumed, those of historians have four to eight."""

LONGEST_DATE = 64
"""Characters of a date at most. Origin: assumed, twice those of the longest."""

LAST_CENTURY = 69
"""Two digits from which on they are a year of the last century. Origin: standard, POSIX strptime.
"""

FIRST_YEAR, LAST_YEAR = 2000, 2060
"""Years between which numbers are looked at as dates: as Unix time in any unit, days of a
spreadsheet, and their like. Origin: assumed, the time of digital recordings."""

FIRST_STEPS = 2**17
"""First samples of a column of times by which the time from row to row is known. Origin: assumed.
"""

BRIEFEST_ROW = 1e-3
"""Seconds from row to row below which days of a spreadsheet are meant: no logger of a plant writes
so fast. Origin: assumed."""

LONGEST_OF_SECONDS = 0.1
"""Seconds from row to row up to which nobody knows whether days or seconds are meant: a day has
2.4 hours in 0.1. Origin: assumed."""

SHARE_ON_CHANGE = 0.5
"""Share of rows with a reading from which on nobody asks whether it is written when it changes.
Origin: assumed."""

SHARE_REGULAR = 0.8
"""Share of distances between readings that are alike, from which on a slow reading is a sampled
one. Origin: assumed."""

ROWS_ON_CHANGE = 10
"""Rows from which on one or two readings are too few for a slow one. Origin: assumed."""

BEYOND_SENSOR = 1e6
"""Times the reference reading and the range of its sensor beyond which a number is no reading.
Origin: assumed; no sensor spans six decades above what its plant runs at."""

ROWS_PER_STEP_BACK = 20
"""Rows per step back in time, on average, below which rows are out of order and no clock was set.
Origin: assumed."""

WRITTEN_TWICE = 3
"""Rows on both sides of a step back with the same times, from which on a clock was set: two rows
alone may have changed places. Origin: assumed."""

CLOCK_LOST = 10.0
"""A step back by this many times what was recorded is a clock that lost its time, not a block of
rows written late. Origin: assumed."""

CLOCK_STOOD = 20
"""Rows in a row with the very same time from which on a clock stood still; fewer are a fast logger.
Origin: assumed."""

# Settled stretches -----------------------------------------------------------------------------

SETTLED = 4.0
"""A reading has settled when it differs from the next few, its drift apart, by this many times its
noise or less. Origin: assumed."""

# Slow motion -----------------------------------------------------------------------------------

USUAL_LAG = 1.0
"""Standard uncertainty of the lag of a reading behind the others, s: the response of its sensor and
the damping set in its transmitter. Origin: assumed; transmitters and converters of process plants
are mostly damped by some tenths of a second to two seconds."""

AGE_OF_SAMPLE = 12.0**-0.5
"""Standard uncertainty of the age of a logged reading, in sampling intervals: it is up to one
interval old. Origin: distribution, rectangular (GUM 4.3.7)."""

LARGEST_INTERVAL = 5.0
"""Time between samples up to which slow motion is judged, s. What comes and goes between two
samples, as a pump that ran for a part of the time, looks like slow motion and is none. Origin:
assumed."""

LONGEST_SLOW = 5
"""Samples of a piece of slow motion, roughly: over more of them laws are not straight. Origin:
assumed."""

# Tables of operating points --------------------------------------------------------------------

MOVING_ROWS = 3.0
"""Median change from row to row, in standard uncertainties of the sensor, of a reading on the move.
Origin: assumed."""

MOVING_READINGS = 2
"""Readings that must be on the move for a table of points: one alone may be a noisy sensor. Origin:
assumed."""

FEWEST_POINTS = 4
"""Rows below which it is not asked whether they are a table of points. Origin: assumed."""

USUAL_CHANGES = 0.99
"""Share of changes from row to row that count as usual: the rest may be a start or a stop. Origin:
assumed."""

LEAP = 1.0
"""Standard deviations of a reading that it never leaps by in a run. Origin: assumed; a ramp of the
independent truth leaps by 0.15 at most, the flow in six tables of pump curves by 3.1 to 3.4."""

# Noise and display of a reading ----------------------------------------------------------------

FEWEST_FOR_CORRELATION = 8
"""Samples below which errors count as independent. Origin: assumed."""

LONGEST_CORRELATION = 0.1
"""Correlation length as a share of the samples at most: no recording shows more. Origin:
assumed."""

WHITE_CORRELATION = 2.0
"""Autocorrelation, times the root of the number of samples, below which it counts as none. Origin:
distribution, 95 % of those of white noise (Bartlett 1946)."""

GLITCH = 8.0
"""A single reading that is this many times the usual step away from both neighbours is none.
Origin: assumed."""

LEAST_USUAL_STEP = 0.02
"""Usual step of a reading at least, as a share of its standard deviation. Origin: assumed."""

FINEST_STEPS = 0.05
"""Share of the steps between levels that are finer than what counts as the least. Origin:
assumed."""

COARSEST_RESOLUTION = 0.05
"""Resolution of a reading as a share of its standard deviation at most. Origin: assumed."""

FINEST_RESOLUTION = 1e-4
"""Resolution of a reading as a share of its standard deviation at least. Origin: assumed."""

SAME_LEVEL = 1e-9
"""Share of its unit and range by which two levels of a reading must differ. Origin: numerical."""

LEAST_NOISE = 1e-300
"""Keeps divisions by the noise of a reading that has none. Origin: numerical."""

FLICKERS = 10
"""Fewest samples between two equal ones that differ from these, of a display that flickers: one may
be a pulse of a set point. Origin: assumed."""

COARSE_LEVELS = 4
"""Fewest levels of a coarse display. Origin: assumed."""

COARSE_SHOWN = 8
"""Fewest readings per level of a coarse display, on average. Origin: assumed."""

MOST_PLACES = 6
"""Decimal places of a display with few levels: fewer than this. Origin: assumed."""

COARSE_UNEVEN = 0.1
"""Largest deviation of a level from an even grid, in steps. Origin: assumed."""

# Sensor health: a reading by itself ------------------------------------------------------------

STILL_RUN = 10
"""Equal readings in a row that may be stuck. Origin: assumed."""

STILL_TIMES = 5.0
"""Times the longest chance run that a stuck reading stands still for. Origin: assumed."""

RESTLESS = 0.7
"""Scatter of third differences, in least steps, from which on a reading has noise of its own (a
smooth course that is rounded has a third); and noise by fourth differences over that by third ones
(equal for noise, next to none for a smooth course). Origin: assumed."""

REPEATED = 0.5
"""Share of readings that repeat the one before, from which on a display is too coarse, or a value
is held too often, for standing still to mean anything: at less, 45 in a row are no chance. Origin:
assumed."""

INSTRUMENT_NOISE = 3.0
"""Noise of an instrument at most, in standard uncertainties of its class: a value that is set moves
by more where it moves, and not at all where it is held. Origin: assumed."""

WRITTEN_DIGIT = 1e-6
"""Share of a step by which a number may miss a multiple of it and still be written in it. Origin:
numerical."""

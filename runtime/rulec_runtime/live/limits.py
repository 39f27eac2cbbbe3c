"""Limits of online monitoring, each with its meaning and its origin."""

KEPT_ROWS = 1024
"""Least number of rows kept with their readings, to judge sensors, noise and settled stretches; at
twice as many the older half becomes operating points. Origin: assumed; seventeen stretches of full
length, more than it takes to report a fault."""

ROWS_IN_TIME = 60
"""Most rows of a block after which the judging pauses as long as it has taken; after more, it is
behind its source. Origin: assumed; a stretch of full length."""

MOST_POINTS = 256
"""Most operating points kept of dropped rows. Origin: assumed; more than four hours at a row a
second, beside `LASTING` of the runtime, over which sensor errors stay constant."""

BLIND_ROWS = 60
"""Number of rows without a judgement after which that is reported. Origin: assumed; a stretch of
full length, so that a move between two operating points is no event."""

WAIT = 0.2
"""Seconds to wait for rows before other work is checked. Origin: assumed; shorter than a person
notices."""

STOOD_STILL = 5.0
"""Seconds between two checks for silence after which this process was busy or frozen, which is no
silence of the source. Origin: assumed; a check comes at least once a second."""

FAILED = 3
"""Exit code if a status of `--fail-on` is active. Origin: assumed; 1 and 2 are mistakes."""

LARGEST_STATE = 2**28
"""Most bytes of a state. Origin: assumed; that of 200 signals has a few megabytes."""

STATE_FORM = 1
"""Version of the form of a saved state. Origin: numerical."""

LAST_PORT = 65535
"""Largest port. Origin: standard, TCP (RFC 9293)."""

PAST = 500
"""Latest events in memory. Origin: assumed; the journal has all."""

KEEP_ALIVE = 10
"""Seconds of silence after which an MQTT broker is pinged. Origin: assumed."""

"""Limits of the sources, each with its meaning and its origin."""

# All sources ---------------------------------------------------------------------------------

STALE = 10.0
"""Seconds of silence after which a source is stale. Origin: assumed; a map may set `stale`."""

FUTURE = 86_400.0
"""Most seconds by which a date of a file may be ahead of this computer's clock. Origin: assumed;
stamps without a zone are up to 14 h ahead."""

TICK = 1.0
"""Most seconds between two checks for silence. Origin: assumed; a tenth of `STALE`."""

AGAIN = 3600.0
"""Seconds after which a recurring remark is repeated with its count. Origin: assumed."""

LONGEST_NOTICE = 400
"""Most characters of a notice. Origin: assumed; five lines of a screen."""

QUEUED_ROWS = 10_000
"""Most rows in the queue; then the oldest are dropped. Origin: assumed; 1000 s at 10 Hz, 16 MB with
200 signals."""

UNCERTAIN = 1
"""The two highest bits of the status of an uncertain value. Origin: standard, OPC 10000-4, 7.39."""

# Files that grow -----------------------------------------------------------------------------

POLL = 0.02
"""Seconds between two checks of a file. Origin: assumed; a fifth of the promised latency."""

PIECE = 1 << 18
"""Most bytes read at a time. Origin: assumed; affects memory alone."""

LONGEST_LINE = 1 << 20
"""Most bytes of a line. Origin: assumed; 40,000 columns."""

LINGER = 1.0
"""Seconds that a replaced file must not grow before the new one is read. Origin: assumed; loggers
write into the old one until they open the new."""

SET_BACK = 20
"""Successive late rows after which a clock without dates has been set back. Origin: assumed; as
`ROWS_PER_STEP_BACK` of a recording."""

STALE_STEPS = 5.0
"""Row intervals without a row after which a file is stale, if longer than `STALE`. Origin:
assumed."""

TAIL = 256
"""Bytes before a position that are compared when reading resumes there. Origin: assumed; some rows
with their times."""

# Maps ------------------------------------------------------------------------------------------

LARGEST_MAP = 1 << 20
"""Most bytes of a map or of a file with a secret. Origin: assumed; 10,000 signals."""

INTERVAL = 1.0
"""Seconds from row to row if a map has no `interval`. Origin: assumed; stretches that settle for
some seconds are judged."""

SHORTEST_INTERVAL = 0.01
"""Least seconds from row to row. Origin: assumed."""

# Connections -----------------------------------------------------------------------------------

OPENING = 6.0
"""Seconds that the start waits for the first answer of a server; then the plant counts as off, and
the connection is retried. Origin: assumed."""

REQUEST = 4.0
"""Seconds that a server has to answer a request. Origin: assumed; asyncua's own timeout."""

CLOSING = 2.0
"""Seconds that a connection has to close; then it is abandoned. Origin: assumed."""

SILENT_INTERVALS = 5.0
"""Publishing intervals without a message after which a connection is given up, if longer than
`SILENT`. Origin: assumed."""

SILENT = 5.0
"""Seconds without a message after which a connection is given up. Origin: assumed."""

FIRST_RETRY = 0.5
"""Seconds until a lost connection is first retried; then twice as long each time. Origin:
assumed."""

LAST_RETRY = 30.0
"""Most seconds between two retries. Origin: assumed."""

CLOCK_APART = 60.0
"""Seconds by which the clock of a source may differ from that of this computer without a notice.
Origin: assumed; computers with NTP agree within a second."""

LATE_INTERVALS = 2.0
"""Most intervals by which the stamp of a value may precede its row and still give its time. Origin:
assumed; the value was sampled in the interval before it was sent."""

NODES_PER_CALL = 100
"""Most nodes of one request. Origin: assumed; small controllers allow so many."""

LARGEST_MESSAGE = 1 << 20
"""Most bytes of an MQTT message. Origin: assumed; 10,000 signals."""

LONGEST_VARINT = 10
"""Most bytes of a 64-bit integer. Origin: standard, Protocol Buffers, Encoding."""

SEQUENCE = 256
"""Modulus of message numbers. Origin: standard, Eclipse Sparkplug 3.0."""

SAME_UNIT = 1e-6
"""Largest relative difference of the factors of equal units. Origin: numerical."""

CHECKING = 15.0
"""Seconds for all requests that check the nodes of a server. Origin: assumed; 200 nodes need four
requests."""

EARLIEST, LATEST = 1e9, 1e10
"""Range of stamps, s since 1970: from 2001 to 2286, so that s, ms, us and ns can be distinguished.
Origin: numerical."""

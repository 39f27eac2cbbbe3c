"""Every number of the sources that decides something: its value, its meaning, its origin."""

from __future__ import annotations

# All sources ---------------------------------------------------------------------------------

STALE = 10.0
"""Seconds without anything from a source from which on it is stale. Origin: assumed; a map states
its own (`stale`)."""

FUTURE = 86_400.0
"""Seconds by which a date of a file may be ahead of this computer's clock. Origin: assumed; stamps
without a zone are up to 14 h ahead."""

TICK = 1.0
"""Seconds between two looks at what has fallen silent at most. Origin: assumed; a tenth of `STALE`.
"""

AGAIN = 3600.0
"""Seconds after which a remark that keeps coming is told again, with how often it came. Origin:
assumed."""

LONGEST_NOTICE = 400
"""Characters of a notice at most. Origin: assumed; five lines of a screen."""

QUEUED_ROWS = 10_000
"""Rows that wait to be taken at most; then the oldest are dropped. Origin: assumed; 1000 s at
10 Hz, 16 MB with 200 signals."""

QUEUED_NOTICES = 1000
"""Notices that wait to be taken at most; then the oldest are dropped. Origin: assumed."""

UNCERTAIN = 1
"""The two highest bits of the status of a value that is uncertain. Origin: standard, OPC 10000-4,
7.39."""

# Files that grow -----------------------------------------------------------------------------

POLL = 0.02
"""Seconds between two looks at a file. Origin: assumed; a fifth of the latency that is promised."""

PIECE = 1 << 18
"""Bytes read at a time at most. Origin: assumed; memory alone."""

LONGEST_LINE = 1 << 20
"""Bytes of a line at most. Origin: assumed; 40,000 columns."""

LINGER = 1.0
"""Seconds that a file which was replaced must not grow until the new one is read. Origin: assumed;
loggers write on into the old one until they open the new."""

SET_BACK = 20
"""Rows in a row that are not later than all before from which on a clock without dates was set
back. Origin: assumed; as `ROWS_PER_STEP_BACK` of a recording."""

STALE_STEPS = 5.0
"""Steps from row to row without a row from which on a file is stale, if that is longer than
`STALE`. Origin: assumed."""

TAIL = 256
"""Bytes before a position that are compared when reading goes on there. Origin: assumed; some rows
with their times."""

# Maps ------------------------------------------------------------------------------------------

LARGEST_MAP = 1 << 20
"""Bytes of a map or of a file with a secret at most. Origin: assumed; 10,000 signals."""

INTERVAL = 1.0
"""Seconds from row to row where a map states no `interval`. Origin: assumed; what is settled for
some seconds is judged."""

SHORTEST_INTERVAL = 0.01
"""Seconds from row to row at least. Origin: assumed."""

# Connections -----------------------------------------------------------------------------------

OPENING = 6.0
"""Seconds that the start waits for the first answer of a server; then the plant is taken to be off
and asked again and again. Origin: assumed."""

REQUEST = 4.0
"""Seconds that a server has to answer a request. Origin: assumed; asyncua's own timeout."""

CLOSING = 2.0
"""Seconds that a connection has to close; then it is abandoned. Origin: assumed."""

SILENT_INTERVALS = 5.0
"""Publishing intervals without a message from which on a connection is given up, if that is longer
than `SILENT`. Origin: assumed."""

SILENT = 5.0
"""Seconds without a message from which on a connection is given up. Origin: assumed."""

FIRST_RETRY = 0.5
"""Seconds until a lost connection is tried again first; then twice as long each time. Origin:
assumed."""

LAST_RETRY = 30.0
"""Seconds between two tries at most. Origin: assumed."""

CLOCK_APART = 60.0
"""Seconds by which the clock of a source may differ from that of this computer; beyond, it is told.
Origin: assumed; computers with NTP agree within a second."""

LATE_INTERVALS = 2.0
"""Intervals by which the stamp of a value may lie before the row that it stands in to be its time.
Origin: assumed; it was sampled in the interval before it was sent."""

NODES_PER_CALL = 100
"""Nodes that one request asks about at most. Origin: assumed; small controllers allow so many."""

LARGEST_MESSAGE = 1 << 20
"""Bytes of an MQTT message at most. Origin: assumed; 10,000 signals."""

KEEP_ALIVE = 10
"""Seconds after which an MQTT broker is asked whether it is there. Origin: assumed."""

GOOD_QUALITY = 192
"""Quality from which on up to 255 a value is good. Origin: standard, OPC Data Access, quality
flags; also Sparkplug 3.0."""

LONGEST_VARINT = 10
"""Bytes of a whole number of 64 bits at most. Origin: standard, Protocol Buffers, Encoding."""

SEQUENCE = 256
"""Numbers of messages before they begin at 0 again. Origin: standard, Eclipse Sparkplug 3.0."""

SAME_UNIT = 1e-6
"""Relative difference of factors up to which two units are the same. Origin: numerical."""

DEEPEST_TYPE = 10
"""Steps from a data type up to the number that it is derived from at most. Origin: assumed."""

CHECKING = 15.0
"""Seconds that all requests which look at the nodes of a server may take. Origin: assumed; 200
nodes need four requests."""

LONGEST_STAMP = 64
"""Characters of a date at most. Origin: standard, ISO 8601: 35 with microseconds and zone."""

EARLIEST, LATEST = 1e9, 1e10
"""Seconds since 1970 that a stamp may be: from 2001 to 2286, so that s, ms, us and ns are told
apart. Origin: numerical."""

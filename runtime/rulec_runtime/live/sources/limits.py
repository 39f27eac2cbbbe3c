"""Every number of the sources that decides something: its value, its meaning, its origin."""

from __future__ import annotations

# All sources ---------------------------------------------------------------------------------

STALE = 10.0
"""Seconds without anything from a source from which on it is stale. Origin: assumed; a map states
its own (`stale`)."""

FUTURE = 86_400.0
"""Seconds by which a date of a file may be ahead of this computer's clock. Origin: assumed; stamps
without a zone are up to 14 h ahead."""

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

STALE_STEPS = 5.0
"""Steps from row to row without a row from which on a file is stale, if that is longer than
`STALE`. Origin: assumed."""

TAIL = 256
"""Bytes before a position that are compared when reading goes on there. Origin: assumed; some rows
with their times."""

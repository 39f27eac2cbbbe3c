"""Limits of the displays, each with its meaning and its origin."""

REDRAWN = 0.2
"""Interval at which the terminal shows news and reads keys, s. Origin: assumed; nobody reads
faster, and drawing costs some 20 ms."""

TICK = 1.0
"""Interval at which the age of the last row and changes by rows alone are shown, s. Origin:
assumed; ages are shown in seconds."""

SILENT = 6.0
"""Silence of the server after which a page reports a lost connection, s. Origin: assumed; six times
`TICK`, with which a page asks for what has changed."""

STATIC = 10
"""Interval at which a browser without scripts reloads the page, s. Origin: assumed."""

MOST_CONNECTIONS = 128
"""Most simultaneous connections; more are refused with 503. Origin: assumed; four per page."""

MOST_OF_AN_ADDRESS = 64
"""Most simultaneous connections of one address. Origin: assumed; half of `MOST_CONNECTIONS`, as all
clients behind a proxy share its address."""

ASKING = 5.0
"""Seconds that a connection may take to send a whole request. Origin: assumed; as long as the
server keeps an idle one open."""

LONGEST_FORM = 4096
"""Most bytes of a form. Origin: assumed; a key and a token have a hundred."""

SHORTEST_TOKEN = 16
"""Least characters of a token, if other machines can reach the page. Origin: assumed; sixteen
random letters cannot be guessed over a network."""

LATEST_EVENTS = 50
"""Past events on a page. Origin: assumed; the journal has all."""

BAR_ENDS = 3.0
"""End of the bar of a residual, in thresholds. Origin: assumed; larger sizes hardly differ."""

"""Limits on reading a Module Type Package, each with its origin."""

# Containers

LARGEST_FILE = 32 << 20
"""Most bytes of a file. Origin: assumed; forty times the largest of ten real ones."""

LARGEST_UNPACKED = 32 << 20
"""Most bytes of the unpacked XML files of a container. Origin: assumed; as `LARGEST_FILE`."""

LARGEST_RATIO = 200
"""Most unpacked bytes per packed byte. Origin: assumed; real ones reach 20, deflate 1032."""

MOST_MEMBERS = 2000
"""Most members of a container. Origin: assumed; real ones have up to three, and pictures."""

MOST_MANIFESTS = 50
"""Most XML files of a container. Origin: assumed; as `MOST_MEMBERS`."""

# XML

DEEPEST = 60
"""Deepest nesting of elements. Origin: assumed; real files have up to ten."""

MOST_ELEMENTS = 200_000
"""Most elements of a container. Origin: assumed; real files have up to 20,000; memory, 100 MB."""

LONGEST_TEXT = 1 << 16
"""Most characters of a value or attribute. Origin: assumed; real ones have some hundred."""

LONGEST_NAME = 300
"""Most characters of a name, an identifier or a unit. Origin: assumed; five times the longest of
ten real files."""

# Output

LONGEST_SIGNAL = 40
"""Most characters of the name of a signal, or of a module in a plant. Origin: standard,
kb/schema/module.schema.json, with one letter to spare."""

LONGEST_MODULE = 60
"""Most characters of the name of a module type. Origin: standard, kb/schema/module.schema.json,
with one letter to spare."""

MOST_SHOWN = 5
"""Most oddities of one kind shown per file; the others are counted. Origin: assumed."""

MOST_TAGS = 20_000
"""Most tags of a module. Origin: assumed; real ones have up to some hundred."""

MOST_DRAWN = 1000
"""Most symbols, or pipes, of a picture for which pipe ends are matched to symbols by distance.
Origin: assumed."""

MOST_LISTED = 2000
"""Most tags, services or connections listed in a skeleton. Origin: assumed; keeps the file within
the size limit of YAML files."""

NEAR_SYMBOL = 0.5
"""Largest distance from the end of a pipe to the edge of the symbol that it joins, as a share of
the symbol's smaller side. Origin: assumed; in real pictures pipes end within the box or a few
pixels off."""

# Asking the controller

ONLINE = 20.0
"""Seconds within which a server must return all units and ranges. Origin: assumed; some hundred
values need a few requests."""

"""The runtime: reads a ruleset and a recording, needs numpy and rich alone."""

"""`rulec watch`: judge a plant while it runs, with a ruleset or a plant compiled on the way."""

import argparse

from rulec_runtime.commands.watch import run as watch

from rulec.commands.arguments import ruleset_of


def run(options: argparse.Namespace) -> int:
    """Watch until the source ends."""
    return watch(options, ruleset_of)

"""Readings of a plant, predicted from its ruleset, settled or over time."""

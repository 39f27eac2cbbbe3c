"""Graphs, steps and balances that know no plant."""

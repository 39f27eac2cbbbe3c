"""Readings over time: files, units, clocks, settled stretches, noise."""

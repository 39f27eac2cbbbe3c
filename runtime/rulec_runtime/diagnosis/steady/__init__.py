"""Settled stretches: estimates of flows, their errors, and the fault that makes them agree."""

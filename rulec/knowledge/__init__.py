"""Module types, faults, effects, fluids and plants: read and checked."""

"""Measurements of parts of `rulec mismatch` that `rulec prove` does not make."""

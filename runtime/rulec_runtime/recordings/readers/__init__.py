"""Readers of formats other than CSV: each needs an extra, and is loaded on demand."""

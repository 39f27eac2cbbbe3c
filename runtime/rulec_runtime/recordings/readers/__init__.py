"""Readers of other formats than CSV: each needs an extra, and is loaded when such a file comes."""

"""Exported code against the plan it was made of: compiled, parsed, and with a central part."""

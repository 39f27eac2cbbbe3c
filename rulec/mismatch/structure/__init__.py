"""Columns that are not what their header says, looked for before any physics."""

"""Columns that differ from their header, sought before any physics."""

"""Observers as code for controllers."""

"""Tests of the suite of concealed effects, and the same chain on real recordings."""

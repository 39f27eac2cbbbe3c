"""The next experiment: which set points tell the explanations apart that still stand."""

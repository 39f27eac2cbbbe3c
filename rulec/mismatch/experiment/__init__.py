"""The next experiment: set points that discriminate between the possible explanations."""

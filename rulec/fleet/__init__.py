"""Many plants on many days: which there are, who judges them, where results go."""

"""Many plants on many days: which there are, how they are judged, where results go."""

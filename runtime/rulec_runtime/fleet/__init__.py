"""Work of a fleet worker: read one plant on one day, judge it, return a row."""

"""Sensor health: is a reading valid? Judged before physics, for everything that reads
recordings."""

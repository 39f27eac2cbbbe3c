"""Sensor health: is a reading valid? Judged before physics, for all that reads recordings."""

"""Sensor health: is a reading one at all? Judged before physics, for all that reads recordings."""

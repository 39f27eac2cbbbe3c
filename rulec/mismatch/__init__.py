"""Where simulation and recording differ: whether, where, by which physics, and the proof."""

"""Where simulation and recording differ: is there a mismatch, where, what physics, the proof."""

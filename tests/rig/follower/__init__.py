"""How fast a plant is followed (`python -m tests.rig.follower`), and what is told of it."""

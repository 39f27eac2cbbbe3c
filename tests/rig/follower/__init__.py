"""How fast a plant is followed, and whether what is told in the end is the diagnosis of the whole:
`python -m tests.rig.follower`."""

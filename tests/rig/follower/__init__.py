"""How fast a plant is followed (`python -m tests.rig.follower`), and whether what is told in the
end is the diagnosis of the whole."""

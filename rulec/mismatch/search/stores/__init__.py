"""The search for plants that store: steps ahead of several models at once."""

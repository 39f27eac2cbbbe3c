"""The search for plants that store."""

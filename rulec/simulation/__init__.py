"""What a plant should show: readings predicted from a ruleset, settled or over time."""

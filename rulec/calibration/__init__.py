"""Parameters fitted to a recording with a true flow."""

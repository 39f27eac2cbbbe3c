"""Evidence over time: errors of the readings of a plant that stores."""

"""Evidence over time: simulation errors of a plant that stores."""

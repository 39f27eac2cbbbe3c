"""Evidence at settled points: errors of the relations of a plant that stores nothing."""

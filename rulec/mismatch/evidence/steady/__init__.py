"""Evidence at settled points: errors in the relations of a plant that stores nothing."""

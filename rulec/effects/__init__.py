"""What a plant may leave out and where; laws joined to it, and plants written with them."""

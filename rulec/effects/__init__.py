"""Effects that a plant may leave out, and where; laws added to it, and plants written with them."""

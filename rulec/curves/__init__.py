"""From the points of a maker's sheet to a module type: the laws of a type, fitted to them."""

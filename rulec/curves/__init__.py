"""Points of a maker's sheet to a module type: the law of a type, fitted to them."""

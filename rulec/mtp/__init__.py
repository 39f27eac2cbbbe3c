"""Module Type Packages (VDI/VDE/NAMUR 2658): read, and written as skeletons of module types."""

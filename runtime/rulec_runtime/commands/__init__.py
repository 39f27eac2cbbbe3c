"""The commands of an operator station."""

"""Displays for the operator: the terminal, and a web page with the same content."""

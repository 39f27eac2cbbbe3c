"""What an operator sees: the terminal, and the same as a web page."""

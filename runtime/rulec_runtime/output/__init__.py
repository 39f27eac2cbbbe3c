"""What leaves the process: text for a terminal, files, cells of a table."""

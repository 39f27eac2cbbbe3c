"""Everything that enters or leaves the process: text for a terminal, files, cells of a table."""

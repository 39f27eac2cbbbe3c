"""What a recording says of one variant of a model: residuals, slopes, values refitted."""

"""Evidence of a recording on one variant of a model: residuals, slopes, refitted values."""

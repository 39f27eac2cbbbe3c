"""One plant on one day: read, judged, told as a row; what a worker of a fleet does."""

"""What others take for the same: one file a peer, each gives rows of the table of `make bench`."""

"""Many pieces of work that do not depend on each other, on this machine or on a cluster."""

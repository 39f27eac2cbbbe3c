"""The demo of a whole plant on one machine: servers of its modules, and `rulec watch`."""

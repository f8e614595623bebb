"""Session: a graph run in virtual time, what is recorded of it, replayed, imported and exported."""

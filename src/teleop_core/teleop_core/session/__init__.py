"""Session: a graph made from a configuration and run in virtual time, recorded or replayed."""

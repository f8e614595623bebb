"""Planning: how much of a hand's motion a slave can follow, before a session is run."""

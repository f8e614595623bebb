"""Planning: computes, before a session is run, how much of a hand's motion a slave can follow."""

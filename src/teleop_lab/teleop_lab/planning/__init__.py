"""Planning: what a slave can follow of a hand's motion, before a session is run."""

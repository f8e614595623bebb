"""Session: a graph that runs in virtual time, and its recordings: recording, replay, import and export."""

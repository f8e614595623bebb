"""Hand: the master side: operators and their tasks, input devices, and the master device in the hand."""

"""Hand: who moves the slave: operators and their tasks, devices, and the master in their hand."""

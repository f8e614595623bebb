"""Chain: from the hand to the command of the slave: operators, master, mapping, fixtures."""

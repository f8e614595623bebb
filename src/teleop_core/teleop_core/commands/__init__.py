"""Commands: what their arguments have in common, and those with a file of their own."""

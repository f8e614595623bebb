"""Commands: their common arguments, and commands that have their own file."""

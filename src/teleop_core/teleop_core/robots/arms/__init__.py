"""Arms by name and by table: Denavit-Hartenberg tables, textbook arms, and the RCRT-1."""

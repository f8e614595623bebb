"""Arms by name and by table: Denavit-Hartenberg tables, those of textbooks, the RCRT-1."""

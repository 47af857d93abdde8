"""What a terminal or another program reads: tables, progress, JUnit."""

"""Temperature: heat runs, and what warmth does to magnets."""

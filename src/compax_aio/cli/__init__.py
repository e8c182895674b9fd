"""At the terminal: programs for people."""

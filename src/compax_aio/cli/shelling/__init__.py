"""A conversation with a drive at the terminal: what may be typed, what it means, and what is answered."""

"""What `compax smc` is made of: its line, and what moves, shows and programs axes on it."""

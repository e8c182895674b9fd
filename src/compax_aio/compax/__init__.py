"""The COMPAX servo drive: its facts, its line, and what a caller holds."""

"""Measurements against other libraries; each module says how it is run."""

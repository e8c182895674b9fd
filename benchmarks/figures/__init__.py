"""The figures of the design, each measured by a module of its own: ``measure(effort)`` returns what it found."""

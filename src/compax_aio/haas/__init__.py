"""Exchange programs and data with Haas CNC controls over a serial line, and read what the machine does."""

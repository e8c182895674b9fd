"""What `compax camm1` is made of: jobs that are read, looked at, drawn and cut, and the line of the cutter."""

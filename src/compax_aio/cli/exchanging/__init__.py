"""What `compax haas` is made of: files that go to controls and come from them, and what controls are asked."""

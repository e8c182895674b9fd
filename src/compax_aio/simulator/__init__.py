"""The far end: simulated devices for tests, demonstrations, teaching and work without a machine."""

"""AMS SMC stepper axes."""

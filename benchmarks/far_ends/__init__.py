"""Far ends that are never the bottleneck, each in a process of its own."""

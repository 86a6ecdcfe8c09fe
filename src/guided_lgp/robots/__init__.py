"""What is derived from a robot's description."""

"""What terms add to: kernels, the slots of poses and joints, and the arrays of a program."""

"""What a robot's description says without words: levers, spheres, hands, mirror images, pairs."""

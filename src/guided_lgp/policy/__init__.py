"""The hierarchical policy: encoding, data set, networks, training and inference."""

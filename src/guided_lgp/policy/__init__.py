"""Policies: what is declared about each, their encodings, samples, training and inference."""

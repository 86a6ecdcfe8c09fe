"""The bounds of the NLP: coarse and path bound, their verification, execution under physics."""

"""The relational policy: one network for any number of grippers, boxes, tables and goals."""

"""Cases beside the paper's: families of problems where geometry decides what comes first.

Each has policies of its own, trained on small problems, and rivals that have none.
"""

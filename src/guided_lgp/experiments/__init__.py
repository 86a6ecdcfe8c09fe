"""The protocols behind the tables: one module per stage, each with ``run(params, root)``.

``root`` is the folder of ``dvc.yaml``; what a stage reads and writes is declared there.
"""

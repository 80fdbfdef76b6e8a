"""Models of hysteresis that `tautscope analyze` compares on a record.

Each file has a frozen dataclass of a model's parameters with `predict`, and a function that fits
it. `docs/models.md` has the formulas and sources; `registry.MODELS` lists the models compared.
"""

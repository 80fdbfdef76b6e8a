"""Models of hysteresis that `tautscope analyze` compares on one record, and what they share.

One file per model: a frozen dataclass of its parameters with `predict`, and a function that fits
it. `docs/models.md` has every formula and its source. A model joins the comparison by one entry
in `registry.MODELS`.
"""

"""Structures with arrays are equal to themselves only: a comparison of arrays is no truth value."""

import ast

from common.paths import ROOT

ARRAYS = ("NDArray", "ArrayLike", "Floats")


def has_arrays(structure: ast.ClassDef) -> bool:
    """Whether a field is an array, and not a function that returns one."""
    fields = [each.annotation for each in structure.body if isinstance(each, ast.AnnAssign)]
    texts = [ast.unparse(field) for field in fields]
    return any(name in text for text in texts for name in ARRAYS if "Callable" not in text)


def test_structures_with_arrays_are_compared_by_identity() -> None:
    decorated = {
        f"{path.stem}.{node.name}": ast.unparse(decorator)
        for path in (ROOT / "python" / "tautscope").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and has_arrays(node)
        for decorator in node.decorator_list
    }
    structures = {name: text for name, text in decorated.items() if text.startswith("dataclass")}
    assert {"rig.Sample", "reduction.Report", "measurement.Tip"} <= set(structures)
    assert [name for name, text in structures.items() if "eq=False" not in text] == []

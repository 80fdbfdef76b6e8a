"""Errors name the field, its value and the allowed values, also across processes."""

import pickle
import subprocess
import sys

import pytest
import tautscope
from tautscope import errors


@pytest.mark.parametrize("kind", errors.FieldError.__subclasses__(), ids=lambda kind: kind.__name__)
def test_an_error_names_field_value_and_allowed_values(kind: type[errors.FieldError]) -> None:
    error = kind("insertion.free_gain", 0.5, "at least 1")
    message = "insertion.free_gain: got 0.5, expected at least 1"
    if kind is errors.MissingPathError:
        message = "File not found: 0.5. Expected at least 1"
    assert str(error) == message
    assert isinstance(error, errors.TautscopeError)
    assert isinstance(error, ValueError)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (again.field, again.value, again.allowed) == (error.field, error.value, error.allowed)


def test_importing_the_package_is_light() -> None:
    script = (
        "import sys, tautscope\n"
        "tautscope.load_config(); tautscope.metrics; tautscope.replay\n"
        "heavy = {'mujoco', 'cv2', 'matplotlib', 'can', 'rich'} & set(sys.modules)\n"
        "sys.exit(f'imported: {heavy}' if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize("name", [name for name in tautscope.__all__ if name != "Twin"])
def test_every_public_name_exists_and_is_documented(name: str) -> None:
    assert name in dir(tautscope)
    value = getattr(tautscope, name)
    assert value.__doc__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'tautscope' has no attribute 'twn'"):
        tautscope.twn  # noqa: B018

"""The stubs of the part in Rust are those of its functions, and the reference page is that of the docstrings."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import haptograph as hg
from haptograph import _native

HERE = Path(__file__).resolve()
STUBS = ast.parse((Path(hg.__file__).parent / "_native.pyi").read_text()).body


def stubbed(body):
    """Of a module or class by its stub: names of functions, with their parameters, and of everything else."""
    functions, others = {}, set()
    for node in body:
        if isinstance(node, ast.FunctionDef):
            marks = {one.id for one in node.decorator_list if isinstance(one, ast.Name)}
            if "property" in marks:
                others.add(node.name)
            else:
                functions[node.name] = [one.arg for one in node.args.args]
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is None:
            others.add(node.target.id)
    return functions, others


def public(owner):
    return {name for name in vars(owner) if not name.startswith("_")}


def parameters(function):
    return list(inspect.signature(function).parameters)


def test_the_stubs_of_functions_are_true():
    functions, others = stubbed(STUBS)
    classes = {node.name for node in STUBS if isinstance(node, ast.ClassDef)}
    assert public(_native) == set(functions) | classes
    assert others == {"__version__"} and isinstance(_native.__version__, str)
    for name, stub in functions.items():
        assert parameters(getattr(_native, name)) == stub, name


@pytest.mark.parametrize("stub", [node for node in STUBS if isinstance(node, ast.ClassDef)], ids=lambda stub: stub.name)
def test_the_stubs_of_classes_are_true(stub):
    real = getattr(_native, stub.name)
    functions, properties = stubbed(stub.body)
    constructor = functions.pop("__new__", None)
    if constructor is None:
        with pytest.raises(TypeError):
            real()
    else:
        assert ["cls", *parameters(real)] == constructor
    assert public(real) == set(functions) | properties
    for name, wanted in functions.items():
        assert parameters(getattr(real, name)) == wanted, name
    for name in properties:
        assert inspect.isgetsetdescriptor(vars(real)[name]), name


def test_the_reference_is_current():
    script = HERE.parents[1] / "reference.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_everything_that_is_exported_is_in_the_reference():
    page = (HERE.parents[3] / "docs/python-reference.md").read_text()
    for name in hg.__all__:
        assert name == "__version__" or f"## hg.{name}" in page, name

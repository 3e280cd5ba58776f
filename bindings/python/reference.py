"""Writes docs/python-reference.md from the package's signatures and docstrings; needs no built package.

    python bindings/python/reference.py          # writes the page
    python bindings/python/reference.py --check  # fails where it is not current
"""

import ast
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "bindings/python/python/haptograph"
PAGE = ROOT / "docs/python-reference.md"
HEAD = """# Reference of the Python package

All that `import haptograph as hg` gives. [haptograph in Python](python.md) is the place to begin.

<!-- Written by bindings/python/reference.py from the docstrings: change those. -->
"""


def exported() -> list[str]:
    """The names of the package, as `__all__` has them."""
    for node in ast.parse((PACKAGE / "__init__.py").read_text()).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == "__all__":
            return ast.literal_eval(node.value)
    raise SystemExit("haptograph/__init__.py has no __all__")


def definitions() -> dict[str, ast.AST]:
    """All classes and functions of the package's modules, by name."""
    found = {}
    for path in sorted(PACKAGE.glob("_*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                found[node.name] = node
    return found


def signature(name: str, function: ast.FunctionDef, is_method: bool) -> str:
    """A call of it, without annotations."""
    arguments = function.args
    for one in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]:
        if one is not None:
            one.annotation = None
    text = ast.unparse(arguments)
    if is_method:
        text = re.sub(r"^(self|cls)(, )?", "", text)
    return f"{name}({text})"


def prose(doc: str) -> str:
    """A docstring in NumPy style as Markdown."""
    doc = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", doc).replace("``", "`")
    lines, out, section = doc.splitlines(), [], None
    is_code = False
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        was_code, is_code = is_code, line.startswith((">>>", "..."))
        if was_code != is_code:
            out.append("```python" if is_code else "```")
        if is_code:
            out.append(re.sub(r"^(>>>|\.\.\.) ?|\s*# doctest: \+SKIP$", "", line))
        elif following and set(following) == {"-"} and len(following) == len(line):
            section = line
            out += [f"*{line}*", ""]
        elif line and set(line) == {"-"} and section is not None:
            continue
        elif section is None or not line:
            out.append(line)
        elif line.startswith("    "):
            out.append(f"  {line.strip()}")
        else:
            name, _, kind = line.partition(" : ")
            out.append(f"- `{name}`" + (f": {kind}" if kind else ""))
    out += ["```"] * is_code
    return "\n".join(out).rstrip() + "\n"


def is_property(function: ast.FunctionDef) -> bool:
    return any(isinstance(one, ast.Name) and one.id == "property" for one in function.decorator_list)


def of_class(node: ast.ClassDef) -> list[str]:
    """A class with its public members."""
    parts = [f"## hg.{node.name}\n", prose(ast.get_docstring(node) or "")]
    for member in node.body:
        doc = ast.get_docstring(member) if isinstance(member, ast.FunctionDef) else None
        if doc is None or (member.name.startswith("_") and member.name != "__init__"):
            continue
        title = member.name if is_property(member) else signature(member.name, member, is_method=True)
        title = f"hg.{node.name}{title.removeprefix('__init__')}" if member.name == "__init__" else f"{node.name}.{title}"
        parts += [f"### `{title}`\n", prose(doc)]
    return parts


def page() -> str:
    """The whole page."""
    known, parts = definitions(), [HEAD]
    for name in exported():
        node = known.get(name)
        if isinstance(node, ast.ClassDef):
            parts += of_class(node)
        elif isinstance(node, ast.FunctionDef):
            parts += [f"## hg.{signature(name, node, is_method=False)}\n", prose(ast.get_docstring(node) or "")]
    return "\n".join(parts)


def main() -> None:
    made = page()
    if "--check" in sys.argv[1:]:
        if not PAGE.exists() or PAGE.read_text() != made:
            raise SystemExit("docs/python-reference.md is not current: run python bindings/python/reference.py")
    else:
        PAGE.write_text(made)


if __name__ == "__main__":
    main()

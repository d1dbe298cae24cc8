"""The house: what neither ruff nor the import contracts can see. `.ci/run` runs these."""

import ast
import re
import tomllib
from itertools import chain

from packaging.requirements import Requirement

from tests.command import loaded
from tests.conftest import ROOT


def test_drake_is_never_imported_with_a_star():
    for path in (ROOT / "src").rglob("*.py"):
        assert not re.search(r"pydrake\S* import \*", path.read_text()), path


def test_views_start_without_drake_and_scikit_learn():
    views = "import ddenv.cli, ddenv.workbench.app, ddenv.scene.__main__, ddenv.cli.follow"
    assert loaded(views, "pydrake", "sklearn") == []


def test_the_first_paint_of_a_run_waits_for_no_slow_import():
    first = "import ddenv.workbench.launch, ddenv.workbench.run.run_screen"
    assert loaded(first, "numpy", "pydantic", "yaml") == []


def test_no_conditional_expression_holds_another_one():
    """One condition can be read within a line; of two the reader loses one."""
    nested = []
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.IfExp):
                parts = [part for part in ast.walk(node) if isinstance(part, ast.IfExp)]
                nested += [f"{path}:{part.lineno}" for part in parts if part is not node]
    assert nested == []


def test_values_are_assigned_one_by_one():
    """`a, b = x, y` hides which value belongs to which name; a swap is the only good one."""
    packed = []
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            match node:
                case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                    is_swap = {*map(ast.unparse, names)} == {*map(ast.unparse, values)}
                    spreads = any(isinstance(one, ast.Starred) for one in values)
                    packed += [f"{path}:{node.lineno}"] * (not is_swap and not spreads)
    assert packed == []


def test_dataclasses_with_many_fields_are_made_with_names():
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.ClassDef):
                continue
            made = " ".join(ast.unparse(one) for one in node.decorator_list)
            fields = [
                part
                for part in node.body
                if isinstance(part, ast.AnnAssign)
                and "ClassVar" not in ast.unparse(part.annotation)
            ]
            if "dataclass" in made and len(fields) > 4:
                assert "kw_only=True" in made, f"{path}: {node.name}"


def test_the_lock_is_of_the_dependencies_that_are_declared_and_of_pypi():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    locked = tomllib.loads((ROOT / "uv.lock").read_text())
    asked = list(chain(declared["dependencies"], *declared["optional-dependencies"].values()))
    (own,) = (each for each in locked["package"] if each["name"] == declared["name"])
    wanted = {(each.name, each.specifier) for each in map(Requirement, asked)}
    assert wanted == {
        (each["name"], Requirement("any" + each.get("specifier", "")).specifier)
        for each in own["metadata"]["requires-dist"]
    }, "uv lock"
    registries = {each["source"].get("registry") for each in locked["package"]}
    assert registries == {"https://pypi.org/simple", None}

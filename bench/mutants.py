"""Would a test notice? Small changes of the code, one at a time, on a copy, against its tests.

``python -m bench.mutants [--count 60] [--seed S] [--only biomech/]`` prints each mutant that no
test noticed, with file, line and change, then how many were killed. A survivor is either a gap in
the tests or no change of behaviour (an equivalent mutant), which only a reader can tell.

Modules that machine code is built from take some minutes each to be compiled again; they are left
out unless ``--compile`` is given.
"""

from __future__ import annotations

import ast
import importlib
import math
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import click
import pytest

from helmet_sim_ros.model.compiled import config, source_digest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "helmet_sim_ros"
#: Beginning of a module's path in the package -> the tests that are its own, most likely first.
TESTS = {
    "biomech/standards.py": ["test_biomech_standards.py", "test_biomech_evaluation.py",
                             "test_tables.py"],
    "biomech/": ["test_biomech_*.py"],
    "mcap_log/": ["test_log_[bpw]*.py", "test_review_reading.py", "test_recover.py",
                  "test_properties.py", "test_log_falls.py"],
    "yaml_file.py": ["test_yaml_file.py", "test_properties.py"],
    "schema.py": ["test_properties.py", "test_tables.py", "test_scenario.py",
                  "test_biomech_standards.py", "test_nodes_parameters.py"],
    "errors.py": ["test_properties.py", "test_yaml_file.py", "test_scenario.py"],
    "model/fall/": ["test_tables.py", "test_fall*.py", "test_log_falls.py"],
    "model/placement.py": ["test_falls.py", "test_model_impact.py", "test_study_certify.py"],
    "model/state.py": ["test_falls.py", "test_log_falls.py"],
    "model/surface/": ["test_tables.py", "test_model_surface_*.py", "test_model_scene.py",
                       "test_replay.py", "test_falls.py", "test_fall_stepping.py"],
    "model/": ["test_tables.py", "test_model_*.py", "test_scenario.py", "test_falls.py",
               "test_fall_stepping.py"],
    "study/certification/": ["test_study_certify.py", "test_tables.py"],
    "study/falls/": ["test_falls_study.py"],
    "study/foams/": ["test_foam_files.py"],
    "study/helmets/": ["test_helmet_import.py", "test_helmet_bad_meshes.py", "test_tables.py"],
    "study/identification/": ["test_study_identify.py", "test_study_histories.py"],
    "study/optimisation/": ["test_study_optimise*.py", "test_tables.py"],
    "study/reconstruction/": ["test_study_reconstruct.py"],
    "study/scenario/": ["test_scenario.py", "test_falls_study.py"],
    "study/sweeps/": ["test_study_file.py", "test_study_sampling.py", "test_study_estimate.py",
                      "test_study_sweep.py", "test_falls_study.py", "test_tables.py"],
    "study/sled.py": ["test_model_neck.py", "test_tables.py"],
    "study/tables.py": ["test_foam_files.py", "test_study_histories.py"],
    "study/validation/": ["test_study_experiments.py", "test_study_foam.py",
                          "test_study_validation.py", "test_tables.py"],
    "report/certification/": ["test_study_certify.py"],
    "report/falls/": ["test_falls_study.py", "test_log_falls.py"],
    "report/figures/": ["test_compare.py", "test_study_identify.py", "test_study_histories.py",
                        "test_foam_files.py", "test_falls_study.py"],
    "report/validation/": ["test_study_experiments.py", "test_study_foam.py",
                           "test_study_validation.py"],
    "report/": ["test_report_page.py", "test_export.py", "test_compare.py", "test_review_cli.py",
                "test_replay.py", "test_log_falls.py", "test_log_helmet.py"],
    "cli/_certification.py": ["test_study_certify.py"],
    "cli/certify.py": ["test_study_certify.py"],
    "cli/_designs.py": ["test_cli_sweep.py", "test_study_optimise.py"],
    "cli/optimise.py": ["test_cli_sweep.py"],
    "cli/_estimates.py": ["test_cli_sweep.py", "test_study_estimate.py", "test_falls_study.py"],
    "cli/_histories.py": ["test_cli_sweep.py", "test_falls_study.py"],
    "cli/_progress.py": ["test_cli_sweep.py"],
    "cli/sweep.py": ["test_cli_sweep.py", "test_falls_study.py"],
    "cli/_falls.py": ["test_falls_study.py", "test_log_falls.py"],
    "cli/fall.py": ["test_falls_study.py", "test_log_falls.py"],
    "cli/_springs.py": ["test_study_identify.py", "test_study_histories.py"],
    "cli/identify.py": ["test_study_identify.py", "test_study_histories.py"],
    "cli/compare.py": ["test_compare.py"],
    "cli/explore.py": ["test_explore_page.py"],
    "cli/export.py": ["test_export.py", "test_log_falls.py"],
    "cli/figures.py": ["test_compare.py", "test_study_validation.py"],
    "cli/helmet.py": ["test_helmet_bad_meshes.py", "test_foam_files.py"],
    "cli/reconstruct.py": ["test_study_reconstruct.py"],
    "cli/recover.py": ["test_recover.py"],
    "cli/replay.py": ["test_replay.py", "test_log_falls.py"],
    "cli/report.py": ["test_report_page.py", "test_cli.py", "test_log_falls.py"],
    "cli/review.py": ["test_review_cli.py", "test_log_falls.py"],
    "cli/validate.py": ["test_study_experiments.py", "test_study_validation.py"],
    "cli/_logs.py": ["test_compare.py", "test_review_cli.py", "test_export.py"],
    "cli/": ["test_cli.py", "test_nodes_process.py", "test_scenario_node.py",
             "test_nodes_trust.py"],
    "explore/": ["test_explore_session.py", "test_explore_stage.py", "test_explore_widgets.py",
                 "test_explore_nodes.py", "test_explore_page.py"],
    "nodes/conversion.py": ["test_nodes_serialised.py", "test_nodes_simulation.py",
                            "test_nodes_recorder.py"],
    "nodes/diagnostics.py": ["test_log_falls.py", "test_review_cli.py", "test_nodes_simulation.py",
                             "test_nodes_falls.py"],
    "nodes/environment.py": ["test_nodes_finish.py", "test_security.py"],
    "nodes/log_session.py": ["test_log_writer.py", "test_log_falls.py", "test_nodes_finish.py",
                             "test_nodes_recorder.py"],
    "nodes/parameters.py": ["test_nodes_parameters.py", "test_nodes_falls.py"],
    "nodes/recorder": ["test_nodes_finish.py", "test_nodes_recorder.py", "test_nodes_trust.py"],
    "nodes/robot_description.py": ["test_model_urdf.py", "test_nodes_simulation.py"],
    "nodes/s": ["test_nodes_serialised.py", "test_nodes_parameters.py", "test_nodes_simulation.py",
                "test_log_falls.py", "test_nodes_falls.py", "test_scenario_node.py",
                "test_nodes_trust.py"],
    "nodes/": ["test_nodes_process.py", "test_nodes_simulation.py", "test_nodes_falls.py",
               "test_scenario_node.py", "test_nodes_trust.py"],
    "present/comparison.py": ["test_compare.py"],
    "present/": ["test_notebook.py", "test_explore_session.py", "test_cli.py"],
    "config_file.py": ["test_yaml_file.py", "test_scenario.py", "test_foam_files.py"],
    "extra.py": ["test_biomech_limits.py", "test_notebook.py"],
    "lasting.py": ["test_cli.py"],
    "lazy.py": ["test_facade.py"],
    "names.py": ["test_facade.py", "test_notebook.py"],
    "resources.py": ["test_yaml_file.py", "test_scenario.py", "test_nodes_trust.py"],
    "views.py": ["test_notebook.py"],
}  # fmt: skip
#: What a copy needs to run the tests.
NEEDED = (PACKAGE, "test", "config", "launch", "bench", "docs", "resource", "scripts", "README.md",
          "CHANGELOG.rst", "package.xml", "pyproject.toml", "setup.py", "setup.cfg")  # fmt: skip
#: What tests need and no mutant changes: loaded once.
LIBRARIES = ("numpy", "scipy.signal", "scipy.optimize", "scipy.stats", "scipy.spatial.transform",
             "mujoco", "pydantic", "yaml", "hypothesis", "mcap.reader", "matplotlib.pyplot",
             "pandas", "pyarrow.parquet", "rosbags.typesys", "rclpy", "std_msgs.msg",
             "diagnostic_msgs.msg", "click.testing", "rich.table", "jinja2")  # fmt: skip
#: Longest run of the tests of a mutant, in times of that without a change; then it hangs.
PATIENCE = 5.0
#: How long the tests of a module are taken to run where that is not measured [s].
PROVEN = 120.0

COMPARED = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
            ast.NotEq: ast.Eq, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot,
            ast.IsNot: ast.Is}  # fmt: skip
COMPUTED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
            ast.Pow: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.BitOr: ast.BitAnd,
            ast.BitAnd: ast.BitOr}  # fmt: skip


class Mutant(NamedTuple):
    """One change of a module: of which node, and in which of its ways."""

    module: Path
    place: int


def mutants_of(root: Path, module: Path) -> list[Mutant]:
    """Every mutant of a module."""
    tree = ast.parse((root / module).read_text(encoding="utf-8"))
    return [Mutant(module, i) for i, node in enumerate(_behaviour(tree)) if _can_change(node)]


def changed(root: Path, mutant: Mutant) -> tuple[str, str]:
    """The text of the module with the change, and the change in words."""
    tree = ast.parse((root / mutant.module).read_text(encoding="utf-8"))
    node = next(node for i, node in enumerate(_behaviour(tree)) if i == mutant.place)
    before, line = ast.unparse(node).splitlines()[0], node.lineno
    _change(node)
    ast.fix_missing_locations(tree)
    after = ast.unparse(node).splitlines()[0]
    words = f"{mutant.module.as_posix()}:{line}: {before[:100]}  ->  {after[:100]}"
    return ast.unparse(tree), words


def _behaviour(tree: ast.AST) -> Iterator[ast.expr | ast.stmt]:
    """The nodes that do something: no annotations, docstrings, messages or imports."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list", "keywords_only", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, (ast.JoinedStr, ast.Raise)):
                continue
            if isinstance(child, (ast.expr, ast.stmt)):
                yield child
            yield from _behaviour(child)


def _can_change(node: ast.AST) -> bool:
    if isinstance(node, ast.Compare):
        return type(node.ops[0]) in COMPARED
    if isinstance(node, (ast.BinOp, ast.AugAssign)):
        return type(node.op) in COMPUTED
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float, bool)
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not)
    if isinstance(node, ast.Return):
        return node.value is not None and ast.unparse(node.value) != "None"
    return isinstance(node, (ast.If, ast.IfExp, ast.While, ast.BoolOp))


def _change(node: ast.AST) -> None:
    """Change a node in place."""
    if isinstance(node, ast.Compare):
        node.ops[0] = COMPARED[type(node.ops[0])]()
    elif isinstance(node, (ast.BinOp, ast.AugAssign)):
        node.op = COMPUTED[type(node.op)]()
    elif isinstance(node, ast.Constant):
        value = node.value
        if isinstance(value, bool):
            node.value = not value
        elif isinstance(value, int):
            node.value = value + 1
        elif isinstance(value, float):
            node.value = value * 1.1 or 1.0
    elif isinstance(node, (ast.If, ast.IfExp, ast.While)):
        node.test = ast.Constant(False)
    elif isinstance(node, ast.BoolOp):
        node.op = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
    elif isinstance(node, ast.UnaryOp):  # not x
        node.operand = ast.UnaryOp(ast.Not(), node.operand)
    elif isinstance(node, ast.Return):
        node.value = ast.Constant(None)


def tests_of(root: Path, module: Path) -> list[str]:
    """The test files of a module in a copy, empty where it has none of its own."""
    inside = module.relative_to(PACKAGE).as_posix()
    for beginning, patterns in TESTS.items():
        if inside.startswith(beginning):
            found = [path for pattern in patterns for path in sorted((root / "test").glob(pattern))]
            # Those that name the module come first: most mutants die in them.
            found.sort(key=lambda path: module.stem not in path.read_text(encoding="utf-8"))
            return [f"test/{path.name}" for path in found]
    return []


def with_machine_code(root: Path) -> set[Path]:
    """The modules that hold compiled functions, or constants and types that they are built with."""
    found: set[Path] = set()
    left = [
        (path.relative_to(root), ("compiled", "inlined"))
        for path in (root / PACKAGE / "model").rglob("*.py")
    ]
    while left:
        module, decorators = left.pop()
        tree = ast.parse((root / module).read_text(encoding="utf-8"))
        used = {
            node.id
            for statement in tree.body if _is_built_with(statement, decorators)
            for node in ast.walk(statement) if isinstance(node, ast.Name)
        }  # fmt: skip
        if module in found or (decorators and not _compiles(tree, decorators)):
            continue
        found.add(module)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(f"{PACKAGE}.model"):
                if used & {alias.asname or alias.name for alias in node.names}:
                    left.append((Path(*str(node.module).split(".")).with_suffix(".py"), ()))
                # A module whose functions are used by its name.
                for alias in node.names:
                    inner = Path(*str(node.module).split("."), f"{alias.name}.py")
                    if (root / inner).is_file() and (alias.asname or alias.name) in used:
                        left.append((inner, ()))
        left = [(m, d) for m, d in left if (root / m).is_file()]
    return found


def _compiles(tree: ast.Module, decorators: tuple[str, ...]) -> bool:
    functions = [s for s in tree.body if isinstance(s, ast.FunctionDef)]
    return any(_is_built_with(function, decorators) for function in functions)


def _is_built_with(statement: ast.stmt, decorators: tuple[str, ...]) -> bool:
    """Whether a statement of a module is a compiled function or may be named in one; without
    decorators: all but imports may be."""
    if isinstance(statement, (ast.Assign, ast.AnnAssign)):
        return True
    if not decorators:
        return not isinstance(statement, (ast.Import, ast.ImportFrom))
    named = [d.id for d in getattr(statement, "decorator_list", ()) if isinstance(d, ast.Name)]
    return bool(set(named) & set(decorators))


def reuse_machine_code(root: Path, digest: str) -> None:
    """Let changed sources of the model use the machine code of those without the change."""
    model = root / PACKAGE / "model"
    folder = model / "__pycache__" / "machine_code"
    link = folder / source_digest(model)
    if (folder / digest).is_dir() and not link.exists():
        link.symlink_to(folder / digest)


def passes(root: Path, tests: list[str], timeout: float | None = None) -> bool:
    """Whether the tests pass in a copy; one that hangs does not."""
    child = os.fork()
    if child == 0:  # has all libraries already, and loads the package of the copy
        os.setsid()
        os._exit(_run_tests(root, tests))
    give_up = time.monotonic() + (math.inf if timeout is None else timeout)
    try:
        while (done := os.waitpid(child, os.WNOHANG))[0] == 0:
            if time.monotonic() > give_up:
                return False
            time.sleep(0.05)  # waitpid has no time-out of its own
    finally:
        with suppress(ProcessLookupError):  # whatever the tests have left running
            os.killpg(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(done[1]) == 0


def _run_tests(root: Path, tests: list[str]) -> int:
    """Pytest's exit code, in a process of its own."""
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    os.chdir(root)
    os.environ |= {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    os.environ.pop("NUMBA_CACHE_DIR", None)  # the copy has its own, see reuse_machine_code
    config.CACHE_DIR = ""
    sys.dont_write_bytecode = True
    for name in list(sys.modules):
        if name.partition(".")[0] in (PACKAGE, "bench"):
            del sys.modules[name]
    sys.path[:] = [str(root), *(path for path in sys.path if Path(path or ".") != ROOT)]
    try:
        return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]))
    except BaseException:
        return 1


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--count", default=60, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=1, show_default=True)
@click.option("--skip", default=0, show_default=True, type=click.IntRange(0),
              help="Leave out the first so many of those that are drawn.")  # fmt: skip
@click.option("--compile", "compiles", is_flag=True,
              help="Also modules that machine code is built from.")  # fmt: skip
@click.option(
    "--proven",
    is_flag=True,
    help="The tests are known to pass without a change: do not run them first.",
)
@click.option("--only", multiple=True, metavar="PREFIX",
              help=f"Modules whose path in {PACKAGE}/ begins so, repeatable.")  # fmt: skip
def main(
    count: int, seed: int, skip: int, compiles: bool, proven: bool, only: tuple[str, ...]
) -> None:
    """Mutate, test and count. Exit code 1: a mutant survived."""
    for library in LIBRARIES:
        with suppress(ImportError):
            importlib.import_module(library)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in NEEDED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, root / name)
        modules = [path.relative_to(root) for path in sorted((root / PACKAGE).rglob("*.py"))]
        wanted = tuple(f"{PACKAGE}/{prefix}" for prefix in only or TESTS)
        modules = [m for m in modules if m.as_posix().startswith(wanted) and tests_of(root, m)]
        skipped = set() if compiles else with_machine_code(root)
        modules = [module for module in modules if module not in skipped]
        digest = source_digest(root / PACKAGE / "model")
        pool = [mutant for module in modules for mutant in mutants_of(root, module)]
        chosen = random.Random(seed).sample(pool, min(count, len(pool)))[skip:]
        click.echo(f"seed {seed}: {len(chosen)} of {len(pool)} mutants of {len(modules)} modules")
        usual: dict[frozenset[str], float] = {}
        survivors = []
        for number, mutant in enumerate(chosen, skip + 1):
            tests = tests_of(root, mutant.module)
            group = frozenset(tests)  # each module has an order of its own
            if group not in usual and proven:
                usual[group] = PROVEN
            elif group not in usual:
                began = time.monotonic()
                if not passes(root, tests):
                    raise SystemExit(f"the tests fail without any change: {' '.join(tests)}")
                usual[group] = time.monotonic() - began
            original = (root / mutant.module).read_text(encoding="utf-8")
            text, words = changed(root, mutant)
            (root / mutant.module).write_text(text, encoding="utf-8")
            if not compiles:
                reuse_machine_code(root, digest)
            if passes(root, tests, PATIENCE * usual[group] + 30.0):
                survivors.append(mutant)
                click.echo(f"survived {number}: {words}")
            (root / mutant.module).write_text(original, encoding="utf-8")
    killed = len(chosen) - len(survivors)
    share = killed / max(len(chosen), 1)
    click.echo(f"seed {seed}: {killed} of {len(chosen)} killed ({share:.0%})")
    raise SystemExit(bool(survivors))


if __name__ == "__main__":
    main()

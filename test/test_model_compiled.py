"""Machine code on disk: never older than any source that it was built from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.errors import NumbaError

from helmet_sim_ros.model import compiled
from helmet_sim_ros.model.compiled import SOURCES, cache_folder, source_digest
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import begun


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the model's sources."""
    folder = tmp_path / "model"
    shutil.copytree(SOURCES, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def test_the_digest_is_that_of_names_and_contents(sources: Path) -> None:
    before = source_digest(sources)
    assert before == source_digest(SOURCES)
    os.utime(sources / "loop.py", (1.0, 1.0))  # dates do not matter
    assert source_digest(sources) == before
    foam = sources / "force" / "foam.py"
    foam.write_text(foam.read_text().replace("YIELD_EXPONENT = ", "YIELD_EXPONENT = 1.0 * "))
    edited = source_digest(sources)
    foam.rename(foam.with_name("foam2.py"))
    renamed = source_digest(sources)
    (sources / "note.txt").write_text("no source")
    assert len({before, edited, renamed, source_digest(sources)}) == 3


PACKAGE = {
    "constant.py": "VALUE = 3.0\n",
    "inner.py": (
        "from {name}.compiled import compiled\n"
        "from {name}.constant import VALUE\n\n\n"
        "@compiled\ndef inner(x: float) -> float:\n    return VALUE * x\n"
    ),
    "outer.py": (
        "from {name}.compiled import compiled\n"
        "from {name}.inner import inner\n\n\n"
        "@compiled\ndef outer(x: float) -> float:\n    return inner(x) + 1.0\n"
    ),
}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A package of two compiled functions and a constant, with the model's way of compiling."""
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(SOURCES / "compiled.py", package)
    for file, text in PACKAGE.items():
        (package / file).write_text(text.replace("{name}", "small"))
    return package


def started(package: Path, code: str) -> subprocess.Popen[str]:
    """A process that runs some code with the package."""
    environment = os.environ | {
        "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"
    }  # fmt: skip
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", code]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True,
                            cwd=package.parent)  # fmt: skip


def test_an_edited_constant_reaches_every_function_that_was_compiled_with_it(small: Path) -> None:
    """A constant in one module, used in a second, called from a third whose file is unchanged."""
    code = (
        "from small.outer import outer\nprint(outer(2.0), sum(outer.stats.cache_hits.values()))\n"
    )

    def run() -> tuple[float, int]:
        """The result, and how much of it came from the disk."""
        value, hits = started(small, code).communicate()[0].split()
        return float(value), int(hits)

    assert run() == (7.0, 0)
    assert run() == (7.0, 1)
    (small / "constant.py").write_text("VALUE = 5.0\n")
    assert run() == (11.0, 0)
    (small / "constant.py").write_text("VALUE = 3.0\n")  # as it was: still there
    assert run()[0] == 7.0
    assert len(list((small / "__pycache__" / "machine_code").iterdir())) == 2


#: Calls a function with what it is told to, as soon as it is told to.
CALLER = """
from small.inner import inner
print("ready", flush=True)
value = eval(input())
print(inner(value), sum(inner.stats.cache_misses.values()))
"""
#: Two processes that have read the index of a function's machine code meet before they write it:
#: unless one waits for the other, both have read the same.
MEETING = """
import os, time
from pathlib import Path
from numba.core.caching import IndexDataCacheFile as Files
save = Files._save_index
def meet(files, index):
    Path(f"there_{os.getpid()}").touch()
    deadline = time.monotonic() + 4.0
    while time.monotonic() < deadline and len(list(Path().glob("there_*"))) < 2:
        time.sleep(0.02)  # for the other process, which the lock must keep away
    save(files, index)
Files._save_index = meet
"""


def called(package: Path, *values: str, first: str = "") -> list[tuple[str, int]]:
    """Results of processes that call ``inner`` at the same time, and what each compiled itself."""
    processes = [started(package, first + CALLER) for _ in values]
    for process in processes:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
    for process, value in zip(processes, values, strict=True):
        assert process.stdin is not None
        process.stdin.write(f"{value}\n")
        process.stdin.flush()
    said = [process.communicate()[0].split() for process in processes]
    return [(result, int(misses)) for result, misses in said]


def test_processes_side_by_side_compile_a_function_once(small: Path) -> None:
    results = called(small, "2.0", "2.0", "2.0")
    assert [result for result, _ in results] == ["6.0"] * 3
    assert sum(misses for _, misses in results) == 1


def test_signatures_that_are_compiled_side_by_side_do_not_replace_each_other(small: Path) -> None:
    both = called(small, "2.0", "2j", first=MEETING)
    assert both == [("6.0", 1), ("6j", 1)]
    assert called(small, "2.0", "2j") == [("6.0", 0), ("6j", 0)]


def test_the_second_process_finds_the_machine_code_of_the_first() -> None:
    from helmet_sim_ros.model.force.spring import loading_force

    assert Path(loading_force._cache.cache_path).is_relative_to(cache_folder())
    loading_force(1.0, 1.0, 1.0)
    assert list(cache_folder().rglob("*.nbi"))


def test_only_old_machine_code_of_other_sources_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "cache" / "helmet_sim_ros"
    monkeypatch.setattr(compiled.numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    for name, age in (("running", 0.5), ("forgotten", 2.0)):
        (root / name).mkdir(parents=True)
        (root / name / "code.nbc").touch()
        then = time.time() - age * compiled.OLD
        os.utime(root / name, (then, then))
    cache_folder.cache_clear()
    try:
        own = cache_folder()
        assert own == root / source_digest()
        assert sorted(path.name for path in root.iterdir()) == sorted([own.name, "running"])
        assert (root / "running" / "code.nbc").exists()
        then = time.time() - 9 * compiled.OLD  # in use for long: still its own
        os.utime(own, (then, then))
        cache_folder.cache_clear()
        assert cache_folder() == own and own.is_dir()
    finally:
        cache_folder.cache_clear()


def test_sources_that_cannot_be_written_to_are_cached_at_the_user_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.touch()  # not a folder: nothing can be made below it
    monkeypatch.setattr(compiled, "SOURCES", blocked)
    monkeypatch.setattr(compiled.numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert compiled._writable_root() == tmp_path / "user" / "helmet_sim_ros" / "machine_code"


def test_compiled_code_that_makes_an_array_is_refused() -> None:
    """It would count references to every array that it touches, at a third of the loop's cost."""

    def total(n: int) -> float:
        return float(np.zeros(n).sum())

    def sum_of(n: int) -> float:
        return float(np.zeros(n).sum())

    with pytest.raises(NumbaError, match="zeros"):
        compiled.compiled(total)(3)
    assert compiled.allocating(sum_of)(3) == 0.0


def test_every_rig_and_helmet_runs_the_same_machine_code() -> None:
    """An array that lies in memory in another order would have the whole loop compiled again."""

    def kind(setup: ImpactSetup | Fall) -> object:
        return numba.typeof(begun(setup)._simulation)

    rider = kind(ImpactSetup())
    for rig, coupling in product(("headform", "rider", "monorail"), ("spring", "foam")):
        setup = ImpactSetup(rig=rig, overrides={"helmet.coupling": coupling})
        assert kind(setup) == rider, (rig, coupling)
    assert kind(ImpactSetup(rig="headform", helmet="none")) == rider
    assert kind(Fall()) == rider

"""Machine code on disk: never older than any source that it was built from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from helmet_sim_ros.model import compiled
from helmet_sim_ros.model.compiled import SOURCES, cache_folder, source_digest


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


def test_an_edited_constant_reaches_every_function_that_was_compiled_with_it(
    tmp_path: Path,
) -> None:
    """A constant in one module, used in a second, called from a third whose file is unchanged."""
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(SOURCES / "compiled.py", package)
    for file, text in PACKAGE.items():
        (package / file).write_text(text.replace("{name}", "small"))
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    code = (
        "from small.outer import outer\nprint(outer(2.0), sum(outer.stats.cache_hits.values()))\n"
    )

    def run() -> tuple[float, int]:
        """The result, and how much of it came from the disk."""
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        value, hits = done.stdout.split()
        return float(value), int(hits)

    assert run() == (7.0, 0)
    assert run() == (7.0, 1)
    (package / "constant.py").write_text("VALUE = 5.0\n")
    assert run() == (11.0, 0)
    (package / "constant.py").write_text("VALUE = 3.0\n")  # as it was: still there
    assert run()[0] == 7.0
    assert len(list((package / "__pycache__" / "machine_code").iterdir())) == 2


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

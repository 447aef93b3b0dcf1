"""Where tests of the bridge's commands are run."""

from __future__ import annotations

from pathlib import Path

import pytest
from courses import COURSE


@pytest.fixture
def no_other_bridge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no bridge of this machine's be found, and none of the test's by others."""
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.delenv("SUDO_UID", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for name in ("SERVICES", "USERS"):
        monkeypatch.setattr(f"firmware_bridge.safety.places.{name}", tmp_path / name)


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_other_bridge: None) -> Path:
    """A folder of its own, with a course and no emergency stop from elsewhere."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "course.toml").write_text(COURSE)
    return tmp_path

"""What tests of the bridge share."""

from __future__ import annotations

from pathlib import Path

import pytest


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

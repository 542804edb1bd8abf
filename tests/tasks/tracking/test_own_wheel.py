"""The wheel that models carry is the package: nothing missing, nothing else, the same bytes every time."""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tasks.tracking.own_wheel import PACKAGES, write_wheel

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_wheel(tmp_path_factory.mktemp("wheel"))


def test_the_same_package_gives_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    assert write_wheel(tmp_path).read_bytes() == wheel.read_bytes()
    assert wheel.stat().st_size < 2e6


def test_each_file_of_the_packages_is_in_the_wheel_with_its_digest_on_record(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as opened:
        contents = {name: opened.read(name) for name in opened.namelist()}
    (record,) = [name for name in contents if name.endswith(".dist-info/RECORD")]
    told = [line.rsplit(",", 2) for line in contents[record].decode().splitlines()]
    assert {name for name, _, _ in told} == set(contents)
    for name, digest, size in told:
        if name != record:
            found = base64.urlsafe_b64encode(hashlib.sha256(contents[name]).digest()).rstrip(b"=").decode()
            assert (digest, size) == (f"sha256={found}", str(len(contents[name])))
    asked = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", *PACKAGES]
    tracked = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in contents if ".dist-info/" not in name} == set(tracked)


def test_pip_installs_it_and_what_is_installed_is_imported(wheel: Path, tmp_path: Path) -> None:
    install = ["install", "--quiet", "--no-deps", "--no-index", "--no-compile", "--target", str(tmp_path)]
    pip = [sys.executable, "-m", "pip"]
    if subprocess.run([*pip, "--version"], capture_output=True, check=False).returncode:
        pytest.skip("pip is not here")
    subprocess.run([*pip, *install, str(wheel)], check=True, capture_output=True)
    code = "import storage.vehicles.vehicle_files as f; f.said_vehicle('car'); print(f.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "n")},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split()[0].startswith(str(tmp_path))

from __future__ import annotations

import subprocess
import sys
from pkgutil import walk_packages

import flows

IMPORT_ALL = "import importlib, sys; [importlib.import_module(name) for name in sys.argv[1:]]"


def test_every_module_of_flows_can_be_imported() -> None:
    """Prefect describes a flow's parameters when it is imported, and cannot describe everything."""
    names = [
        module.name for module in walk_packages(flows.__path__, "flows.") if "__main__" not in module.name
    ]
    subprocess.run([sys.executable, "-c", IMPORT_ALL, *names], check=True)

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages

import flows


def test_every_module_of_flows_can_be_imported() -> None:
    """Prefect describes a flow's parameters when it is imported, and cannot describe everything."""
    for module in walk_packages(flows.__path__, "flows."):
        import_module(module.name)

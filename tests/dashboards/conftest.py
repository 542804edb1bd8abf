from __future__ import annotations

import pandas as pd
import pytest

from tests.dashboards import synthetic


@pytest.fixture(scope="session")
def attempt_rows() -> pd.DataFrame:
    return synthetic.attempts()


@pytest.fixture(scope="session")
def recall_rows() -> pd.DataFrame:
    return synthetic.recalls()

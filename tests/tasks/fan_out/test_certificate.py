from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509

from tasks.fan_out import fan_out

pytestmark = pytest.mark.filterwarnings("ignore")  # of Dask's libraries


def test_a_clock_that_is_set_back_by_hours_ends_no_connection_of_a_local_cluster(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started = []

    def cluster(**settings: object) -> None:
        started.append(settings["security"])
        raise KeyboardInterrupt  # enough is seen

    monkeypatch.setattr(fan_out, "LocalCluster", cluster)
    with pytest.raises(KeyboardInterrupt), fan_out.cluster(1):
        pass
    (security,) = started
    assert security.require_encryption
    certificate = x509.load_pem_x509_certificate(security.tls_worker_cert.encode())
    assert certificate.not_valid_before_utc <= datetime.now(UTC) - timedelta(hours=12)
    assert certificate.not_valid_after_utc >= datetime.now(UTC) + timedelta(days=300)

"""The flows that retrain as the schedule imports them, in a process of its own that shows its notices."""

from __future__ import annotations

import os
from contextlib import suppress

from flows.cli.terminal import show_notices
from flows.retrain import retrain as retrain_flow
from flows.retrain_library import retrain_library as retrain_library_flow
from tasks.servers.listening import end_with_parent
from tasks.session.ending import started_by_prefect

retrain = started_by_prefect(retrain_flow)
retrain_library = started_by_prefect(retrain_library_flow)

show_notices()
with suppress(PermissionError):  # if it leads a group already
    os.setpgid(0, 0)  # Ctrl-C is for `serve`, which ends this process and its workers
end_with_parent()  # even if `serve` is killed; Prefect's own server ends, too

"""The flows that retrain as the schedule imports them, in a process of its own that shows its notices."""

from __future__ import annotations

from flows.cli.terminal import show_notices
from flows.retrain import retrain as retrain_flow
from flows.retrain_library import retrain_library as retrain_library_flow
from tasks.servers.listening import end_with_parent
from tasks.session.ending import started_by_prefect

retrain = started_by_prefect(retrain_flow)
retrain_library = started_by_prefect(retrain_library_flow)

show_notices()
end_with_parent()  # even if `serve` is killed; Prefect's own server ends, too

"""What the variants of a sweep came to, as a table."""

from __future__ import annotations

import pandas as pd
from rich import box
from rich.table import Table


def sweep_table(rows: pd.DataFrame) -> Table:
    """One line for each variant (columns of ``tasks.stages.sweep.sweep_rows``), by class, the best first."""
    table = Table(
        title="Validation problems, % of what the stored plans solve",
        title_justify="left",
        box=box.SIMPLE_HEAD,
    )
    for heading in ("class", "rate", "channels", "hidden", "parameters", "hit@1", "hit@5", "seconds"):
        table.add_column(heading, justify="left" if heading == "class" else "right", no_wrap=True)
    for name, of_class in rows.groupby("class", sort=False):
        best = of_class.sort_values("hit@1", ascending=False, kind="stable")
        for i, row in enumerate(best.to_dict("records")):
            table.add_row(
                str(name) if i == 0 else "",
                f"{row['learning_rate']:g}",
                row["channels"],
                row["hidden"] or "none",
                f"{row['parameters']:,}",
                f"{100.0 * row['hit@1']:.1f}",
                f"{100.0 * row['hit@5']:.1f}",
                f"{row['seconds']:.0f}",
                end_section=i == len(best) - 1,
            )
    return table

"""The Prefect flows, which decide when things happen: one per file, as short as a paragraph."""

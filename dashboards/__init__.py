"""What users look at: rows to tables and figures, which say nothing that the rows do not."""

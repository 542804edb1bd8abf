"""One file a stage: its chunks, and how one of them is done."""

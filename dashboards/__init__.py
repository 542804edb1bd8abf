"""What users look at: rows to tables and figures, which say nothing that the rows do not."""

import logging

# The first figure on a machine has matplotlib list its fonts, and tell so on the error stream.
logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)

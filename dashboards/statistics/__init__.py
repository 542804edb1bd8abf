"""From attempt rows to means, intervals, tests and rates."""

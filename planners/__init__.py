"""The pure core: true with no scheduler, disk or screen."""

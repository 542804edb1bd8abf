"""What each command of the command line takes, and whom it calls; what one needs is imported in it."""

"""The command line: options, what each command calls, errors and exit codes."""

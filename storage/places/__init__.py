"""Where files lie: data folders, whole files, object storage and its local copy, leases."""

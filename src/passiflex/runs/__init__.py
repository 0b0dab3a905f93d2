"""A run, its file, and what is left of a damaged one."""

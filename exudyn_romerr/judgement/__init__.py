"""What is known of every sensor and cause of a run, one answer each, as every page and exit status has it."""

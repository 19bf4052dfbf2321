"""Scripts as users have them, without a line of ours: run, watched, and run again to measure."""

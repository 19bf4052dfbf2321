"""Many variations of one function: where they run, files that keep their results, a table of these."""

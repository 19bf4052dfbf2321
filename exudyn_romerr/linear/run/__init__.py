"""What is done once before a run, ending in small arrays; bounds along a run, from samples in to a report out."""

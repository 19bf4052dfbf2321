"""What is done once before a run, ending in small constants only."""

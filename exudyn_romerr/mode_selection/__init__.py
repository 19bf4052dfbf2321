"""Which modes are enough: forecast from one run, and what choose_modes returns; tables of what modes there are."""

"""Pictures of a report. Matplotlib is imported when one is drawn."""

"""Estimates: the error itself, by cause, and how far that can be trusted; nothing here knows Exudyn."""

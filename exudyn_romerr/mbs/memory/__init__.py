"""What user functions keep from call to call: found, kept, and put back after they were tried."""

"""The linearised mechanism: bodies with auxiliary vectors, and its tangents at stored steps."""

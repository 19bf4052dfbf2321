"""A body in a floating frame: loads, joints, sensors, scope, samples."""

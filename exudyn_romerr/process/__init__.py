"""What belongs to the whole process of the user: set while we compute, and put back."""

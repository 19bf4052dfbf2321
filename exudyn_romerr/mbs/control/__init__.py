"""Controllers, user functions whose forces follow the motion: what they are to first order, and stay."""

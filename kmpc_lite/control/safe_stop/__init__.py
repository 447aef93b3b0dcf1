"""The stop trajectory that every plan must have, and what is driven when there is no plan."""

"""The other end of each link, for desks without a robot: speaks the real bytes."""

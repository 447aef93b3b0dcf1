"""A link between a controller and a robot's motors that stays safe when anything fails."""

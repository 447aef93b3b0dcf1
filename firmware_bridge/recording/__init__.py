"""Recording, replay and excitation."""

"""Recording and excitation."""

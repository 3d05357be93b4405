"""The particle reference: simulated spheres that obey the collision rule of the models."""

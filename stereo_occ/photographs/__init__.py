"""From two photographs of a calibrated pair to what networks take, and back into the photographs."""

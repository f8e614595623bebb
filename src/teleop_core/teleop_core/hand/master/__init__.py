"""Master: the simulated haptic device and the hand that holds it."""

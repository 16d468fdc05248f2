"""What light does to a fabric, and what a network learns of it."""

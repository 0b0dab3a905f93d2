"""A scenario resolved on its robot: numbers, and other numbers in their place."""

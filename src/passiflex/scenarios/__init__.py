"""What a scenario file says: its entries with units, and their mistakes."""

"""What people write: text files, YAML with line and column, numbers with units, and mistakes with the nearest name."""

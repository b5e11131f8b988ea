"""Fields of small networks whose colours are mixtures of a palette."""

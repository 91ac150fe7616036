"""What a configuration must satisfy beyond types: every problem, one line each with key, value and remedy."""

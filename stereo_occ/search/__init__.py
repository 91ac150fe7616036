"""Search for settings with Optuna: ``hydra/sweeper=optuna``."""

"""Where a training writes what it sees: TensorBoard, a CSV file, Weights & Biases, MLflow."""

"""Pictures over time: commands, errors, step times; and how well the model predicts."""

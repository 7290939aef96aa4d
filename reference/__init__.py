"""What the tracer is judged by: the model in plain scalar Python, and the table of tolerances."""

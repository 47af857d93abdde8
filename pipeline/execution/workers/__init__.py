"""How a task is run: processes or a cluster, with retries and limits."""

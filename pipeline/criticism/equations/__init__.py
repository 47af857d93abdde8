"""What is measured, what the model predicts, and which parameters each kind of test observes."""

"""The linear loop, and the one judgement of whether it holds."""

"""Evaluation: goals and scores; nothing of the agent imports this."""

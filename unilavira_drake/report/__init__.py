"""The report: one page that shows why the agent did what it did."""

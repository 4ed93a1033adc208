"""The paper, figure by figure, and what it left open, with a report that sets its claims beside ours."""

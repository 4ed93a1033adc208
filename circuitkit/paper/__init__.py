"""Holds what only the paper needs: its equations, figures, report and the search of its gaits."""

"""Report: scores and plots of recordings as one self-contained page."""

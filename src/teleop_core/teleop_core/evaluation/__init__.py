"""Evaluation: scores of recordings, beside the published figures."""

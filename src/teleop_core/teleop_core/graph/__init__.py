"""Graph: stages, topics and links: the one description of what runs."""

from teleop_core.graph import topics as topics  # for tc.topics

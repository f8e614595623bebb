"""People: studies with people at the console; their scores are compared with the simulated operator's."""

from teleop_lab.people.compare import people_dataset
from teleop_lab.people.journal import Journal
from teleop_lab.people.plan import Plan, read_plan

__all__ = ["Journal", "Plan", "people_dataset", "read_plan"]

"""The study: many trainings of small policies, each from data to trials, and the tables that answer its questions."""

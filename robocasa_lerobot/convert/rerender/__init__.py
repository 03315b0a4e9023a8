"""Pictures of a dataset rendered again."""

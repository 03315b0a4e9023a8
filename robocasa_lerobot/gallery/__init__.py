"""Pictures and pages for people: tasks, kitchens, appliances and objects."""

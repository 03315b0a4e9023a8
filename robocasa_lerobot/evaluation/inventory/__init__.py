"""What data there are, in numbers and on a page."""

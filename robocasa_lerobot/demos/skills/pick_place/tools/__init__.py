"""What a held tool or vessel is used for: wiping, stirring, pouring."""

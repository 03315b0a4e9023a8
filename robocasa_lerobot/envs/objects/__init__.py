"""Objects that lie about in a kitchen: categories, their instances, and shapes made from primitives."""

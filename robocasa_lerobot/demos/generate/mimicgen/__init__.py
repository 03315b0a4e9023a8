"""Generation as MimicGen has it: whole subtasks carried over by their object, joined by lines, with a base at rest."""

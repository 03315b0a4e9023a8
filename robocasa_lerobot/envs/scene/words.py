"""What instructions and stages are said with: fixtures by role, objects by name, what was drawn, lists and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from robocasa_lerobot.envs.kitchens.layout import Layout

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_SAME_IN_PLURAL = ("s", "meat", "rice", "bread", "fish", "shrimp", "broccoli", "garlic")  # ends of such words


class Words(dict[str, str]):
    """Words by name; `a+b` of objects is a list: "the apple and the pear", "both carrots", "all three carrots".

    Of an object of which several were drawn, its own name is such a list, `<name>_count` their number in letters, and
    `<name>_all` "both" or "all three" (nothing where there is one).

    Args:
        words: by name.
        members: of every object, or object of which several were drawn, what each of them is called.
    """

    def __init__(self, words: Mapping[str, str] | None = None, members: Mapping[str, Sequence[str]] | None = None):
        super().__init__(words or {})
        self._members = dict(members or {})

    def __missing__(self, key: str) -> str:
        """The list of what `a+b` names.

        Raises:
            KeyError: one of them is no object.
        """
        if "+" not in key:
            raise KeyError(key)
        return listed([word for name in key.split("+") for word in self._members[name]])


def words_of(layout: Layout, roles: Mapping[str, str], categories: Mapping[str, str], several: Iterable[str]) -> Words:
    """What a scene's fixtures (by role) and objects (by name) are called.

    Args:
        layout: of the kitchen.
        roles: fixture of each role.
        categories: category of each object.
        several: names of objects of which a number was drawn, `<name>_0` being the first.
    """
    words = {role: fixture_word(layout.types[name]) for role, name in roles.items()}
    for name in roles.values():
        fixture = layout.fixtures[name]
        if fixture.door_names:
            words.setdefault("doors", _doors_word(fixture.door_names))
        for part in fixture.compartments:
            words.setdefault(f"{part}_doors", _doors_word(fixture.doors_of(part)))
    said = {name: object_word(category) for name, category in categories.items()}
    words |= said
    members: dict[str, Sequence[str]] = {name: (word,) for name, word in said.items()}
    for name in several:
        members[name] = [said[each] for each in numbered(name, said)]
        words[name] = listed(members[name])
        words[f"{name}_count"] = number_word(len(members[name]))
        words[f"{name}_all"] = _all(len(members[name]))
    return Words(words, members)


def _doors_word(doors: Sequence[str]) -> str:
    return "door" if len(doors) == 1 else "doors"


def said(wording: str, words: Mapping[str, str]) -> str:
    """A wording with its words; a missing one (a rack that needs no name) leaves no double space."""
    return " ".join(wording.format_map(words).split())


def numbered(name: str, names: Iterable[str]) -> tuple[str, ...]:
    """Of `names`, those of an object: itself, or where several were drawn `<name>_0`, `<name>_1`, ... in order."""
    known = set(names)
    if name in known:
        return (name,)
    found: list[str] = []
    while f"{name}_{len(found)}" in known:
        found.append(f"{name}_{len(found)}")
    return tuple(found)


def fixture_word(kind: str) -> str:
    """What a type of fixture is called."""
    return "fridge" if kind.startswith("fridge") else "stove" if kind.startswith("stove") else kind.replace("_", " ")


def object_word(category: str) -> str:
    """What a kind of object is called: a kettle is one that is not electric, as nobody says."""
    return category.removesuffix("_non_electric").replace("_", " ")


def listed(words: Sequence[str]) -> str:
    """Objects in a list, those of one kind together: "the apple, the two pears and the lime"."""
    counts: dict[str, int] = {}
    for word in words:
        counts[word] = counts.get(word, 0) + 1
    if len(counts) == 1:
        ((word, count),) = counts.items()
        return f"the {word}" if count == 1 else f"{_all(count)} {plural(word)}"
    parts = [
        f"the {word}" if count == 1 else f"the {number_word(count)} {plural(word)}" for word, count in counts.items()
    ]
    return " and ".join([", ".join(parts[:-1]), parts[-1]]) if parts else ""


def number_word(count: int) -> str:
    """A number in letters."""
    return _NUMBERS[count] if count < len(_NUMBERS) else str(count)


def plural(word: str) -> str:
    """Several of a kind of object: "knives", "tomatoes"; some are the same in number ("tacos", "broccoli")."""
    if word.endswith(_SAME_IN_PLURAL) and not word.endswith("ss"):
        return word
    if word.endswith(("ch", "sh", "x", "ss", "ato")):
        return f"{word}es"
    if word.endswith("y") and word[-2] not in "aeiou":
        return f"{word[:-1]}ies"
    if word.endswith(("knife", "loaf")):
        return {"e": f"{word[:-2]}ves", "f": f"{word[:-1]}ves"}[word[-1]]
    return f"{word}s"


def _all(count: int) -> str:
    return "" if count == 1 else "both" if count == 2 else f"all {number_word(count)}"

"""Demonstrations by hand: a kitchen that is driven in a browser, recorded as demonstrators are (see `protocol.md`)."""

"""From a phase's settings to what it trains with."""

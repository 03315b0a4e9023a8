"""Dataset mixtures, statistics, frame caching and a tiny fake dataset for tests."""

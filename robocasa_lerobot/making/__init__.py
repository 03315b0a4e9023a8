"""Making the data that an experiment needs: the one room that knows experiments, demonstrators and conversion."""

"""One file for each kind of appliance."""

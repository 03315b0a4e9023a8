"""What policies and simulators behind a socket say to each other, without a policy or a simulator."""

"""Live settings: the catalogue, updates, the policy, requests, the file, the history."""
